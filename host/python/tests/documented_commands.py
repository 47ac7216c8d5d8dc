"""Every command in README.md, docs/ and the command line's examples: run here in a cheap form, run by another test, or not run
and why. test_documented_commands.py holds this list to what is written there.
"""

# A run that is long enough to touch, and its files.
_BRIEF = "--set duration_s=0.4 --set outputs.node_times_s=[] --set outputs.pictures=false"
_BRIEF_NATIVE = f"{_BRIEF} --board native"

# command -> what is run in its place, as arguments of palpate; {out}: a folder that is empty at first, {record}: of a
# brief run of scenes/press.toml.
RUN = {
    "./run --help": "--help",
    "./run doctor": "doctor",
    "./run doctor --json": "doctor --json",
    "./run fuzz TARGET [--runs N]": "fuzz scene --runs 5",
    "./run completion bash": "completion bash",
    "./run run scenes/press.toml --board native": f"run scenes/press.toml {_BRIEF_NATIVE} --out {{out}}",
    "./run run scenes/press.toml --board native --medium canfd": (
        f"run scenes/press.toml {_BRIEF_NATIVE} --medium canfd --out {{out}}"
    ),
    "./run run scenes/press.toml --board native --set model.builder=krylov --out out/krylov": (
        f"run scenes/press.toml {_BRIEF_NATIVE} --set model.builder=krylov --out {{out}}"
    ),
    "./run run scenes/press.toml --set contact.friction=0.5 --set model.builder=krylov": (
        f"run scenes/press.toml {_BRIEF} --set contact.friction=0.5 --set model.builder=krylov --out {{out}}"
    ),
    "./run run scenes/frontier/reference.toml --board mps2_an500 --set model.builder=hybrid --set model.near_nodes=4"
    ' --set "model.middle_shifts_Hz=[20.0, 40.0, 300.0]" --set model.basis_latency_ticks=90 --set reference.enabled=true'
    " --set reference.step_s=2.5e-5": (
        "run scenes/frontier/reference.toml --board mps2_an500 --set model.builder=hybrid --set model.near_nodes=4"
        ' --set "model.middle_shifts_Hz=[20.0, 40.0, 300.0]" --set model.basis_latency_ticks=90 --set duration_s=0.3 --out {out}'
    ),
    "./run run scenes/frontier/reference.toml --board native --set model.builder=hybrid --set 'path.csv=\"poke_0.1mm.csv\"'"
    " --set body.stiffness_N_m=10000 --set integrator.step_s=2e-5 --set reference.enabled=true --set reference.step_s=1e-5": (
        "run scenes/frontier/reference.toml --board native --set model.builder=hybrid --set 'path.csv=\"poke_0.1mm.csv\"'"
        " --set body.stiffness_N_m=10000 --set integrator.step_s=2e-5 --set duration_s=0.1 --set reference.enabled=true"
        " --set reference.step_s=1e-5 --out {out}"
    ),
    "./run run scenes/stick.toml --board mps2_an500 --set model.builder=hybrid --set model.near_nodes=12": (
        f"run scenes/stick.toml {_BRIEF} --board mps2_an500 --set model.builder=hybrid --set model.near_nodes=12 --out {{out}}"
    ),
    './run run scenes/stick.toml --board native --set model.builder=krylov [--set "model.shifts_Hz=[0.0, 20.0]"]': (
        f"run scenes/stick.toml {_BRIEF_NATIVE} --set model.builder=krylov --set 'model.shifts_Hz=[0.0, 20.0]' --out {{out}}"
    ),
    "./run run scenes/stick.toml --board native --set model.builder=krylov --set model.basis_latency_ticks=300": (
        f"run scenes/stick.toml {_BRIEF_NATIVE} --set model.builder=krylov --set model.basis_latency_ticks=300 --out {{out}}"
    ),
    "./run run scenes/frontier/reference.toml --set 'path.csv=\"drag_10cm_s.csv\"' --set duration_s=1.65 --set contact.friction=0"
    " --set model.builder=hybrid [--set model.patch_ahead=false]": (
        "run scenes/frontier/reference.toml --set 'path.csv=\"drag_10cm_s.csv\"' --set duration_s=0.3 --set contact.friction=0"
        " --set model.builder=hybrid --set model.patch_ahead=false --board native --out {out}"
    ),
    "./run mesh scenes/liver.toml --out out/mesh": "mesh scenes/liver.toml --out {out}",
    "./run mesh scenes/meshes/sphere.obj --scale 0.001 --cell 0.01 --json": (
        "mesh scenes/meshes/sphere.obj --scale 0.001 --cell 0.01 --json"
    ),
    "./run replay out/press/record.h5": "replay {record} --board native --out {out}",
    "./run replay out/press/record.h5 --set model.builder=krylov --board native --tolerance-N 0.5": (
        "replay {record} --set model.builder=krylov --board native --tolerance-N 5 --out {out}"
    ),
    "./run plot out/press/record.h5": "plot {record} --out {out}",
    "./run plot out/press/record.h5 --from 0.4 --to 0.7 --what forces,path": (
        "plot {record} --from 0.1 --to 0.3 --what forces,path --out {out}"
    ),
    "./run choose scenes/auto.toml": "choose scenes/auto.toml",
    "./run choose scenes/auto.toml --set link.baud=2600000 --board mps2_an500 --json": (
        "choose scenes/auto.toml --set link.baud=2600000 --board mps2_an500 --json"
    ),
    "./run choose SCENE.toml": "choose scenes/press.toml",
    "./run choose SCENE [--record record.h5]": "choose scenes/press.toml --record {record}",
    "./run run scenes/auto.toml": f"run scenes/auto.toml {_BRIEF_NATIVE} --out {{out}}",
    "./run simulate scenes/wave2d.toml": (
        "simulate scenes/wave2d.toml --set duration_s=0.05 --set outputs.node_times_s=[] --out {out}"
    ),
    "./run simulate scenes/press.toml --set duration_s=0.5 --json": (
        f"simulate scenes/press.toml {_BRIEF} --json --out {{out}}"
    ),
    "./run reduce --dim 2 --n 6": "reduce --dim 2 --n 6 --out {out}",
    "./run reduce --dim 2 --n 12 --damping 1.0 --order 20": "reduce --dim 2 --n 6 --damping 1.0 --order 10 --out {out}",
}

# command -> the test that runs it, or the part of it that costs.
TESTED = {
    "./run calibrate /dev/ttyACM0": "hil_tests/test_calibrate.py::test_the_command_writes_its_report",
    "./run calibrate /dev/ttyACM0 --show --json": "hil_tests/test_calibrate.py::test_the_command_at_a_board_in_real_time",
    "./run calibrate /dev/ttyACM0 --set setpoint.gain=1.02,0.99,1": "hil_tests/test_calibrate.py::test_the_command_at_a_board_in_real_time",
    "./run flash --board nucleo_g474re": "host/python/tests/test_flash.py::test_openocd_programs_verifies_and_starts_the_image",
    "./run flash --board nucleo_g474re --medium usb --by dfu-util": "host/python/tests/test_flash.py::test_others_get_the_image_as_it_lies_in_flash",
    "./run run scenes/stick.toml --board nucleo_g474re --medium canfd --set model.builder=hybrid": "hil_tests/test_nucleo.py::test_a_scene_over_can_fd",
    "./run build --board nucleo_g474re": "hil_tests/test_nucleo_images.py::test_each_image_keeps_its_budgets",
    "./run build --board feather_stm32f405": "hil_tests/test_skeletons.py::test_it_builds_within_its_budgets_and_says_what_it_lacks",
    "./run build --board NAME": "hil_tests/test_skeletons.py::test_it_builds_within_its_budgets_and_says_what_it_lacks",
    "./run demo": "hil_tests/test_loop_repeats.py::test_the_demo_gives_one_record_on_both_boards",
    "./run demo --board native --out out/native": (
        "hil_tests/test_loop_repeats.py::test_the_demo_gives_one_record_on_both_boards"
    ),
    "./run run": "host/python/tests/test_core.py::test_run_touches_the_body",
    "./run run SCENE": "host/python/tests/test_core.py::test_run_touches_the_body",
    "./run run SCENE --set": "host/python/tests/test_api.py::test_an_experiment_is_that_of_the_command_line",
    "./run run SCENE.toml": "host/python/tests/test_core.py::test_run_touches_the_body",
    "palpate run": "host/python/tests/test_core.py::test_run_touches_the_body",
    "./run simulate SCENE": "host/python/tests/test_core.py::test_simulation_exports_nodes",
    "./run simulate SCENE.toml": "host/python/tests/test_core.py::test_simulation_exports_nodes",
    "palpate simulate": "host/python/tests/test_core.py::test_simulation_exports_nodes",
    "./run gui": "hil_tests/test_gui.py::test_touch_and_look",
    "build/host/host/device_api/example_wall serial:/dev/pts/3 10": (
        "hil_tests/test_device_api.py::test_the_command_says_its_address_and_ends_when_interrupted"
    ),
    "cmake --install build/host --component device --prefix PREFIX": (
        "hil_tests/test_device_api.py::test_it_installs_and_a_program_builds_against_it"
    ),
    "cmake --build --preset host --target example_wall": "hil_tests/test_device_api.py::test_it_installs_and_a_program_builds_against_it",
    "cmake --build --preset host --target palpate_device": (
        "hil_tests/test_device_api.py::test_it_installs_and_a_program_builds_against_it"
    ),
    "./run device --play": (
        "hil_tests/test_device_api.py::test_the_command_over_udp_as_json"
    ),
    "./run device [SCENE.toml]": "hil_tests/test_device_api.py::test_the_command_over_udp_as_json",
    "./run device": "hil_tests/test_device_api.py::test_the_command_says_its_address_and_ends_when_interrupted",
    "./run device scenes/press.toml --play --link udp-listen:127.0.0.1:5760 --duration 10": (
        "hil_tests/test_device_api.py::test_the_command_over_udp_as_json"
    ),
    "./run gui [SCENE.toml]": "hil_tests/test_gui.py::test_touch_and_look",
    "./run gui scenes/stick.toml --board mps2_an386 --set contact.friction=0.5": (
        "hil_tests/test_gui.py::test_controls_by_script"
    ),
    "xvfb-run -a ./run gui --script hil_tests/gui_scripts/touch.py --json": "hil_tests/test_gui.py::test_touch_and_look",
    "xvfb-run -a ./run gui --duration 5 --screenshot out/gui.png": "hil_tests/test_gui.py::test_touch_and_look",
    "./run replay RECORD.h5 [--set KEY=VALUE]": "hil_tests/test_loop_replay.py::test_the_command_line",
    "palpate replay FILE": "hil_tests/test_loop_replay.py::test_the_command_line",
    "./run plot RECORD.h5": "host/python/tests/test_plot.py::test_the_command_line",
    "palpate plot FILE": "host/python/tests/test_plot.py::test_the_command_line",
    "./run reproduce": "host/python/tests/test_reproduce_report.py::test_all_figures_from_end_to_end",
    "./run reproduce all": "host/python/tests/test_reproduce_report.py::test_all_figures_from_end_to_end",
    "./run reproduce fig14": "host/python/tests/test_reproduce_report.py::test_all_figures_from_end_to_end",
    "./run reproduce --hil --out out/hil": "hil_tests/test_reproduce_boards.py::test_figure_15_on_both_boards",
    "./run reproduce [table1 ... locality ... fig17]": (
        "host/python/tests/test_reproduce_report.py::test_all_figures_from_end_to_end"
    ),
    "./run reproduce [fig4 table1 table2 fig5 fig8 frontier locality fig12 ... fig17 late | all]": (
        "host/python/tests/test_reproduce_report.py::test_all_figures_from_end_to_end"
    ),
    "./run reproduce fig4 table1 table2 fig5 fig8": (
        "host/python/tests/test_reproduce_report.py::test_all_figures_from_end_to_end"
    ),
    "./run reproduce table1 table2 fig4 fig5 fig8": (
        "host/python/tests/test_reproduce_report.py::test_all_figures_from_end_to_end"
    ),
    "./run reduce": "host/python/tests/test_reduce_command.py::test_the_papers_square",
    "./run reduce [--scene SCENE.toml]": "host/python/tests/test_reduce_command.py::test_order_and_node_follow_what_is_asked",
    "palpate reduce --n": "host/python/tests/test_reduce_command.py::test_the_papers_square",
    "./run reduce --check-locality SCENE [--press M]": (
        "host/python/tests/test_reduce_command.py::test_a_body_that_is_not_local_fails_the_check"
    ),
    "./run reduce --check-locality scenes/reduce/soft_core.toml": (
        "host/python/tests/test_reduce_command.py::test_a_homogeneous_body_is_local_and_the_others_are_not"
    ),
    "./run reduce --check-locality scenes/reduce/stiff_skin.toml": (
        "host/python/tests/test_reduce_command.py::test_a_homogeneous_body_is_local_and_the_others_are_not"
    ),
    "./run bench frontier": "host/python/tests/test_frontier.py::test_the_command_writes_what_it_prints",
    "./run bench mutants --file motor_heat.hpp --sample 20 --json": "host/python/tests/test_supervisor_mutants.py::test_a_sample_is_killed",
    "./run bench faults --only unplugged drop --json": "host/python/tests/test_faults.py::test_the_matrix_breaks_no_rule",
    "./run bench frontier --quick": "host/python/tests/test_frontier.py::test_the_command_writes_what_it_prints",
    "./run bench links --help": "host/python/tests/test_cli.py::test_every_bench_has_a_help_of_its_own",
    "./run bench links": "host/python/tests/test_link_bench.py::test_no_medium_carries_more_than_it_can",
    "./run bench links --quick": "host/python/tests/test_link_bench.py::test_no_medium_carries_more_than_it_can",
    "palpate bench links": "host/python/tests/test_link_bench.py::test_no_medium_carries_more_than_it_can",
    "./run bench frontier [--quick] [--json] [--out DIR]": (
        "host/python/tests/test_frontier.py::test_the_command_writes_what_it_prints"
    ),
    "palpate bench frontier": "host/python/tests/test_frontier.py::test_the_command_writes_what_it_prints",
    "source <(./run completion bash)": "host/python/tests/test_completion.py::test_bash_completes",
    ".venv/bin/python docs/examples/touch_a_body.py": "host/python/tests/test_examples.py::test_touch_a_body",
    ".venv/bin/python docs/examples/compare_builders.py": "host/python/tests/test_examples.py::test_compare_builders",
    ".venv/bin/python docs/examples/connect_to_a_board.py": "host/python/tests/test_examples.py::test_connect_to_a_board",
    ".venv/bin/python -m mkdocs build --strict": (
        "host/python/tests/test_docs.py::test_the_site_builds_without_a_warning_and_fetches_nothing"
    ),
    ".venv/bin/python hil_tests/linux_guest.py -- bash -c '": "hil_tests/test_linux_guest.py::test_the_command_line_runs_a_command_and_ends_with_its_code",
    "PYTHONPATH=host/python .venv/bin/python -m palpate device --link can:vcan0 --duration 5 --play": "hil_tests/test_linux_guest.py::test_the_command_line_runs_a_command_and_ends_with_its_code",
    "pip install .": "host/python/tests/test_wheel.py::test_a_body_is_touched",
    "python -m palpate.docs": "host/python/tests/test_docs.py::test_generated_tables_are_up_to_date",
    "./run mesh FILE": "host/python/tests/test_mesh_command.py::test_a_surface_is_filled",
    "palpate mesh": "host/python/tests/test_mesh_command.py::test_a_scene_is_checked_and_drawn",
    "python host/bench/mesh_modulus.py": "host/python/tests/test_mesh_network.py::test_a_cube_under_tension",
    "python host/bench/servo_rate.py": "hil_tests/test_tick_cycles.py::test_a_patch_of_eight_nodes_is_in_time_at_4_kHz",
    "python host/bench/scene_numbers.py": "host/python/tests/test_docs.py::test_the_measured_numbers_are_those_of_a_run",
    "python host/bench/fault_numbers.py": "host/python/tests/test_faults.py::test_the_matrix_breaks_no_rule",
    "python host/bench/contact_tick.py": "hil_tests/test_contact_tick.py::test_every_kind_of_tick_is_measured",
    "python host/bench/contact_tick.py --out contact_tick.json": (
        "hil_tests/test_contact_tick.py::test_every_kind_of_tick_is_measured"
    ),
    "PYTHONPATH=host/python python host/bench/contact_lead.py": (
        "host/python/tests/test_contact_lead.py::test_a_steady_press_has_the_force_of_the_mean_of_the_tick"
    ),
    "python host/bench/usb_cost.py": "hil_tests/test_usb.py::test_what_a_packet_costs_the_board",
    "python host/bench/supervisor_coverage.py": "host/python/tests/test_supervisor_coverage.py::test_every_line_and_branch_is_reached",
    "python host/bench/board_cost.py": "hil_tests/test_board_cost.py::test_no_model_takes_more_than_predicted",
    "python host/bench/tick_cycles.py --situations 60": (
        "hil_tests/test_tick_cycles.py::test_ticks_stay_below_the_bound_and_have_the_instructions_of_the_clock"
    ),
}

_TOO_LONG = "a measurement of minutes"
_BUILDS = "builds and is run by ctest and ./run, not from within a test"
_A_WHOLE_BODY = "minutes on 1,728 nodes; the same on smaller bodies is tested in test_reduce_command.py"

# command -> why no test runs it.
NOT_RUN = {
    "./run": "installs packages and builds: what starts the tests cannot be one of them",
    ".venv/bin/python -m nunavut --target-language c --outdir out/dsdl shared/wire/dsdl/palpate": (
        "every build runs it, into a folder of its own (shared/wire/CMakeLists.txt)"
    ),
    "./run fuzz board --runs 2000": _BUILDS,
    "./run fuzz all --json": _BUILDS,
    "./run fuzz all": _BUILDS,
    "./run fuzz board --time-s 600 --ledger": _BUILDS,
    "./run fuzz can --time-s 60 --keep": _BUILDS,
    "./run fuzz can --time-s 60 --ledger": _BUILDS,
    "./run test": "the tests themselves",
    "./run test --quick": "the tests themselves",
    "./run test [--quick]": "the tests themselves",
    "./run test --only test_scene link_test": "the tests themselves",
    "./run run drag.toml --json": "a scene of that page's reader",
    "./run reduce --scene scenes/demo.toml": _A_WHOLE_BODY,
    "./run reduce --check-locality scenes/demo.toml": _A_WHOLE_BODY,
    "./run reduce --check-locality scenes/demo.toml --press 0.005": _A_WHOLE_BODY,
    "palpate record 1": "no command: the name of a format",
    "./run bench mutants": _TOO_LONG + "; a sample is host/python/tests/test_supervisor_mutants.py",
    "./run bench faults": _TOO_LONG,
    "./run bench stability --zwidth": "host/python/tests/test_stability.py::test_the_table_is_of_the_file",
    "./run bench stability --zwidth --quick --json": "host/python/tests/test_stability.py::test_the_table_is_of_the_file",
    "./run bench faults --medium canfd": _TOO_LONG,
    "./run bench faults --medium usb": _TOO_LONG,
    "./run bench faults --medium can": _TOO_LONG,
    "./run bench faults --board mps2_an386 --quick": _TOO_LONG,
    "./run bench faults --medium usb --board mps2_an386 --quick": _TOO_LONG,
    "build/host/host/bench/model_builders": _TOO_LONG,
    "build/host/host/bench/paper_contact > paper_contact.json": _TOO_LONG,
    "build/host/host/bench/edge_jumps > edge_jumps.json": _TOO_LONG,
    "build/host/host/bench/contact_energy > contact_energy.json": _TOO_LONG,
    "PYTHONPATH=host/python python host/bench/edge_jumps_board.py": _TOO_LONG,
    "PYTHONPATH=host/python python host/bench/edge_jumps_board.py > edge_jumps_board.json": _TOO_LONG,
    "PYTHONPATH=host/python python host/bench/coupling.py --out out/coupling": _TOO_LONG,
    "PYTHONPATH=host/python python host/bench/reduction.py --out out/reduction": _TOO_LONG,
    "python host/bench/model_choice.py": _TOO_LONG,
    "python host/bench/tick_cycles.py --log PIPE --image build/mps2_an386/boards/mps2_an386/palpate_mps2_an386.elf": _TOO_LONG,
    "cmake --preset mps2_an386 && cmake --build --preset mps2_an386 --target contact_tick_mps2_an386": _BUILDS,
    "cmake --preset mps2_an386 && cmake --build --preset mps2_an386": _BUILDS,
    "cmake --preset host && cmake --build --preset host --target paper_contact": _BUILDS,
    "cmake --preset host && cmake --build --preset host --target edge_jumps": _BUILDS,
    "cmake --preset host && cmake --build --preset host --target contact_energy": _BUILDS,
    "cmake --preset host && cmake --build --preset host --target basis_scaling": _BUILDS,
    "cmake --build --preset host --target paper_contact && build/host/host/bench/paper_contact": _BUILDS,
}
