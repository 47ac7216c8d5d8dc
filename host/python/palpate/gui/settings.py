"""What the window's controls stand for: a scene with some of its keys set otherwise, on a board."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from palpate.live import is_address
from palpate.scene import Scene, load_scene

BUILDERS = ("patch", "patch_rescaled", "condensed", "krylov", "hybrid")
BAUDS = (921_600, 3_000_000, 6_000_000, 12_000_000)
_KEYS = {
    "stiffness_N_m": "body.stiffness_N_m",
    "young_modulus_Pa": "body.mesh.young_modulus_Pa",
    "damping_ratio": "body.damping_ratio",
    "friction": "contact.friction",
    "builder": "model.builder",
    "update_Hz": "rates.model_update_Hz",
    "baud": "link.baud",
}


@dataclass
class Settings:
    """Values of the controls that need a new start. Those that nobody has touched leave the scene as it is. board: a name in
    `hil.BOARDS`, or the address of an attached one."""

    file: Path
    board: str
    overrides: dict[str, Any] = field(default_factory=dict)

    def set(self, name: str, value: Any) -> None:
        """name: stiffness_N_m, young_modulus_Pa, damping_ratio, friction, builder, update_Hz or baud. KeyError for another."""
        self.overrides[_KEYS[name]] = value

    def scene(self) -> Scene:
        """Raises SceneError as load_scene does."""
        return load_scene(self.file, self.overrides, None if is_address(self.board) else self.board)


def shown(scene: Scene) -> dict[str, Any]:
    """Of a scene, what the controls show, by the names of `Settings.set`: of a lattice its springs' stiffness, of a mesh its Young's
    modulus."""
    values = scene.to_dict()
    return {
        **_material(scene, values["body"]),
        "friction": values["contact"]["static_friction"],
        "builder": values["model"]["builder"],
        "update_Hz": values["rates"]["model_update_Hz"],
        "baud": values["link"]["baud"],
    }


def _material(scene: Scene, body: dict[str, Any]) -> dict[str, Any]:
    given = scene.sections.body
    if given.mesh is not None:
        ratio = 1.0 if given.damping_ratio is None else given.damping_ratio
        return {"young_modulus_Pa": given.mesh.young_modulus_Pa, "damping_ratio": ratio}
    critical_N_s_m = (2.0 * body["mass_kg"] * body["stiffness_N_m"]) ** 0.5
    return {"stiffness_N_m": body["stiffness_N_m"], "damping_ratio": body["damping_N_s_m"] / critical_N_s_m}
