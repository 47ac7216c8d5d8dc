"""A body made of a mesh: touched, coloured by stress, recorded with its mesh, made softer, and another one opened."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from stages import run  # noqa: E402

IDLE, RENDER = 1, 3
ABOVE_M = [-0.022, 0.003, 0.042]
PRESSED_M = [-0.022, 0.003, 0.0345]


def stages(app):
    live = app.live
    assert "young_modulus_Pa" in app.shown and "stiffness_N_m" not in app.shown
    app.view.colouring = "stress"
    while live.status["board_mode"] != IDLE:
        yield
    live.arm()
    while live.status["board_mode"] != RENDER:
        yield
    app.record()
    app.guide_hand(PRESSED_M)
    while live.contact is None or live.contact.mode == "free" or -live.contact.force_N @ live.contact.normal < 0.1:
        yield
    # The patch is drawn, and there is stress: 0.1 N on a square centimetre are 1 kPa.
    while live.picture is None or len(live.picture.patch_nodes) == 0 or app.view.range[0] < 0.5:
        yield
    app.stop_recording()
    kept = app.last_recording.parent / "liver.msh"
    assert kept.read_bytes() == (app.settings.file.parent / "meshes/liver.msh").read_bytes()
    app.guide_hand(ABOVE_M)
    stiff = app.live.scene.network.stiffness_N_m
    app.set("young_modulus_Pa", 0.5 * app.shown["young_modulus_Pa"])
    app.apply()
    assert app.message == "" and app.live is not live, app.message
    # The capsule has a modulus of its own, and keeps it.
    softer = app.live.scene.network.stiffness_N_m
    assert 0.5 * stiff.min() <= softer.min() < stiff.min() and softer.max() <= stiff.max()
    app.set("builder", "hybrid")
    app.apply()
    assert "model.builder" in app.message, app.message
    app.open(app.settings.file.parent / "skin.toml")
    assert app.live.scene.file.stem == "skin", app.message
    while app.live.picture is None:
        yield


step = run(stages)
