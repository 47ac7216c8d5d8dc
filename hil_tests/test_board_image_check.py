"""boards/cmake/check_image.py: the budgets of a firmware image, and the deepest stack from GCC's call graphs."""

import json
import os
import re
import shutil
import subprocess
import sys

import pytest
from board_peer import BUILD_MPS2, MPS2_IMAGE, REPOSITORY

SCRIPT = REPOSITORY / "boards/cmake/check_image.py"
CONTEXTS = ["start_up", "uart1_receive_handler", "timer0_handler", "report_hard_fault"]

sys.path.insert(0, str(SCRIPT.parent))
from check_image import LIBRARY_STACK_BYTES, CallGraph  # noqa: E402


def check(flash: int, ram: int, objects: list) -> subprocess.CompletedProcess:
    return subprocess.run(
        [sys.executable, SCRIPT, "--image", MPS2_IMAGE, "--compiler", shutil.which("arm-none-eabi-g++"),
         "--flash", str(flash), "--ram", str(ram), "--contexts", *CONTEXTS, "--objects", *objects],
        capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def objects():
    """Of the firmware's image: not those that want a heap, nor the golden trace, which has a main program of its own, nor the
    image with USB. As the build has them now: its folder may hold others from before."""
    commands = json.loads((BUILD_MPS2 / "compile_commands.json").read_text("utf-8"))
    names = [re.search(r" -o (\S+)", command["command"])[1] for command in commands]
    return [BUILD_MPS2 / name for name in names if not re.search("uses_|golden|usb", name)]


def test_the_image_is_within_the_part(objects):
    result = check(512 * 1024, 128 * 1024, objects)
    assert (result.returncode, result.stderr) == (0, "")
    assert "deepest stack" in result.stdout


def test_each_budget_can_fail(objects):
    result = check(1000, 2000, objects)
    assert result.returncode == 1
    problems = result.stderr.splitlines()
    assert len(problems) == 2 and "flash" in problems[0] and "RAM" in problems[1]


def test_a_function_without_call_graph_fails(objects):
    result = check(512 * 1024, 128 * 1024, [path for path in objects if "supervisor" not in path.name])
    assert result.returncode == 1 and "supervise" in result.stderr and "its stack is not known" in result.stderr


def graph(tmp_path, stacks: dict, calls: list[tuple[str, str]], names_of_address=None, indirect=None) -> CallGraph:
    file = tmp_path / os.urandom(4).hex()
    lines = [f'node: {{ title: "{name}" label: "void {name}()\\n/a.cpp:1:1\\n{stack}" }}'
             for name, stack in stacks.items()]
    lines += [f'edge: {{ sourcename: "{source}" targetname: "{target}" label: "/a.cpp:2:2" }}'
              for source, target in calls]
    file.write_text("\n".join(lines))
    return CallGraph([file], names_of_address or {}, indirect or set())


def test_the_deepest_path_counts(tmp_path):
    one = graph(tmp_path,
                {"a": "8 bytes (static)", "b": "100 bytes (static)", "/x.cpp:c": "16 bytes (dynamic,bounded)"},
                [("a", "b"), ("a", "/x.cpp:c"), ("/x.cpp:c", "memcpy")])
    assert one.deepest("a") == 108
    assert one.deepest("c") == 16 + LIBRARY_STACK_BYTES
    assert one.unbounded == []


@pytest.mark.parametrize(("stacks", "calls", "problem"), [
    ({"a": "8 bytes (static)", "b": "8 bytes (static)"}, [("a", "b"), ("b", "a")], "recursion: a -> b -> a"),
    ({"a": "8 bytes (static)"}, [("a", "printf")], "printf, called by a: its stack is not known"),
    ({"a": "8 bytes (static)"}, [("a", "__indirect_call")], "__indirect_call, called by a: its stack is not known"),
    ({"a": "8 bytes (dynamic)"}, [], "a: stack frame of unknown size"),
])
def test_what_cannot_be_bounded_is_a_problem(tmp_path, stacks, calls, problem):
    one = graph(tmp_path, stacks, calls)
    one.deepest("a")
    assert one.unbounded == [problem]


def test_start_up_runs_the_constructors(tmp_path):
    one = graph(tmp_path, {"start_up": "8 bytes (static)", "_GLOBAL__sub_I_x": "40 bytes (static)"},
                [("start_up", "__indirect_call")])
    assert one.deepest("start_up") == 48


def test_a_call_through_a_pointer_goes_to_the_deepest_that_it_may_go_to(tmp_path):
    one = graph(tmp_path, {"a": "8 bytes (static)", "b": "16 bytes (static)", "c": "24 bytes (static)"},
                [("a", "__indirect_call"), ("b", "a2")], indirect={"b", "c"})
    one.leave_out({"a2"})
    assert one.deepest("a") == 32
    assert one.unbounded == []


def test_names_of_one_function_share_its_stack(tmp_path):
    one = graph(tmp_path, {"a": "8 bytes (static)", "C2": "24 bytes (static)"}, [("a", "C1"), ("C2", "a2")],
                {0x100: ["C1", "C2"], 0x200: ["a2"]})
    one.stack_bytes["a2"] = 4
    assert one.deepest("a") == 36
