"""Examples for the help of each command, as they are typed in the repository; a test runs them or says which test does."""

EXAMPLES: dict[str, tuple[str, ...]] = {
    "demo": ("./run demo", "./run demo --board native --out out/native"),
    "run": (
        "./run run scenes/press.toml --board native",
        "./run run scenes/press.toml --set contact.friction=0.5 --set model.builder=krylov",
    ),
    "replay": (
        "./run replay out/press/record.h5",
        "./run replay out/press/record.h5 --set model.builder=krylov --board native --tolerance-N 0.5",
    ),
    "plot": ("./run plot out/press/record.h5", "./run plot out/press/record.h5 --from 0.4 --to 0.7 --what forces,path"),
    "simulate": ("./run simulate scenes/wave2d.toml", "./run simulate scenes/press.toml --set duration_s=0.5 --json"),
    "reproduce": ("./run reproduce fig14", "./run reproduce --hil --out out/hil"),
    "reduce": (
        "./run reduce --dim 2 --n 6",
        "./run reduce --check-locality scenes/reduce/stiff_skin.toml",
    ),
    "bench": ("./run bench frontier --quick", "./run bench links --help"),
    "bench frontier": ("./run bench frontier --quick",),
    "bench links": ("./run bench links --quick",),
    "bench stability": ("./run bench stability --zwidth", "./run bench stability --zwidth --quick --json"),
    "bench faults": ("./run bench faults --only unplugged drop --json", "./run bench faults --board mps2_an386 --quick"),
    "bench mutants": ("./run bench mutants", "./run bench mutants --file motor_heat.hpp --sample 20 --json"),
    "choose": (
        "./run choose scenes/auto.toml",
        "./run choose scenes/auto.toml --set link.baud=2600000 --board mps2_an500 --json",
    ),
    "mesh": ("./run mesh scenes/liver.toml --out out/mesh", "./run mesh scenes/meshes/sphere.obj --scale 0.001 --cell 0.01 --json"),
    "gui": (
        "./run gui",
        "./run gui scenes/stick.toml --board mps2_an386 --set contact.friction=0.5",
        "xvfb-run -a ./run gui --duration 5 --screenshot out/gui.png",
    ),
    "fuzz": ("./run fuzz board --runs 2000", "./run fuzz can --time-s 60 --ledger", "./run fuzz all --json"),
    "device": (
        "./run device",
        "./run device scenes/press.toml --play --link udp-listen:127.0.0.1:5760 --duration 10",
    ),
    "calibrate": (
        "./run calibrate /dev/ttyACM0",
        "./run calibrate /dev/ttyACM0 --show --json",
        "./run calibrate /dev/ttyACM0 --set setpoint.gain=1.02,0.99,1",
    ),
    "flash": ("./run flash --board nucleo_g474re", "./run flash --board nucleo_g474re --medium usb --by dfu-util"),
    "doctor": ("./run doctor", "./run doctor --json"),
    "completion": ("source <(./run completion bash)",),
    "test": ("./run test --quick", "./run test --only test_scene link_test"),
}


def epilog(command: str, more: str) -> str:
    """The examples of a command, one a line, and what every help ends with."""
    lines = "".join(f"  {example}\n" for example in EXAMPLES[command])
    return f"examples:\n{lines}\n{more}"
