"""`palpate bench stability --zwidth`, in its quick form, and the bounds beside it. The walls themselves: host/bench/virtual_wall_test.cpp."""

import json
import re
from typing import Any

import pytest

from palpate import _core, cli
from palpate.stability import command, zwidth
from palpate.stability.zwidth import Servo


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], str]:
    folder = tmp_path_factory.mktemp("stability") / "out"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("sys.stderr.isatty", lambda: False)
        assert cli.main(["bench", "stability", "--zwidth", "--quick", "--out", str(folder)]) == 0
    assert (folder / command.PICTURE).stat().st_size > 10_000
    values: dict[str, Any] = json.loads((folder / command.RESULTS).read_text("utf-8"))
    return values, command.format_tables(values)


def test_bounds_are_those_of_the_papers() -> None:
    board = Servo()
    assert zwidth.colgate_N_m(board) == pytest.approx(2 * 0.005 / 1e-3)
    assert zwidth.quantization_N_m(board) == pytest.approx(2 * 0.04 / 30e-6)
    assert zwidth.quantization_N_m(Servo(count_m=0.0)) is None


def test_the_controller_bears_stiffer_walls(done: tuple[dict[str, Any], str]) -> None:
    values, _ = done
    for servo in zwidth.QUICK_SWEEPS["rate_Hz"]:
        without, controlled = (zwidth.of(values["walls"], servo, on)[0] for on in (False, True))
        assert without["damping_N_s_m"] == controlled["damping_N_s_m"] == 0.0
        assert controlled["stiffest_N_m"] > 3 * without["stiffest_N_m"] > 3 * without["colgate_N_m"]


def test_a_faster_servo_bears_stiffer_walls(done: tuple[dict[str, Any], str]) -> None:
    values, _ = done
    stiffest = [zwidth.of(values["walls"], servo, False)[0]["stiffest_N_m"] for servo in zwidth.QUICK_SWEEPS["rate_Hz"]]
    assert stiffest == sorted(stiffest) and stiffest[0] < stiffest[-1]


def test_the_table_is_of_the_file(done: tuple[dict[str, Any], str]) -> None:
    values, table = done
    numbers = [row["stiffest_N_m"] for servo in zwidth.QUICK_SWEEPS["rate_Hz"] for row in zwidth.of(values["walls"], servo, True)]
    assert [float(number.replace(",", "")) for number in re.findall(r"/ ([\d,]+)", table)] == [round(number) for number in numbers]
    assert "1 kHz" in table and "[N/m]" in table


def test_a_servo_out_of_range_is_refused() -> None:
    with pytest.raises(ValueError, match=r"rate_Hz: must be in \[100, 20000\] Hz"):
        _core.stiffest_wall_N_m(zwidth.DEVICE, 1.0, 0, 0.0, False, 0.0, 1.0, 1e-3)
    with pytest.raises(KeyError, match="mass_kg"):
        _core.stiffest_wall_N_m({}, 1000.0, 0, 0.0, False, 0.0, 1.0, 1e-3)
