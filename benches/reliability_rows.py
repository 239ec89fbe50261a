"""The rows of the scoreboard in `docs/reliability.md`, and the tests behind each."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Row:
    """Something that must hold.

    Attributes:
        name: in the table.
        what: what holds, for a reader.
        python: tests as pytest names them.
        rust: names of tests of the program `worlds`, or parts of them.
        long: parts of a command that run apart; each keeps a result of its own, under its name.
        missing: what is not tested yet; the row then holds in part.
    """

    name: str
    what: str
    python: tuple[str, ...] = ()
    rust: tuple[str, ...] = ()
    long: tuple[str, ...] = ()
    missing: str = ""

    @property
    def tests(self) -> tuple[str, ...]:
        """All names: a result counts only for the tests that it was found with."""
        return (*self.python, *(f"worlds {name}" for name in self.rust))


_BATCH, _DAMAGE = "tests/envs/test_batch_", "tests/records/test_damage.py::test_"
_NEIGHBOURS = f"{_BATCH}env.py::test_threads_and_neighbours_change_no_byte"
_FUZZ_SNAPSHOTS = "tests/envs/test_batch_snapshots.py::test_forged_snapshots_are_refused_or_go_on"

ELSEWHERE = "benches/digests_elsewhere.py"
"""The command that runs the committed digests on other processors."""
SOAK = "benches/soak.py --parts"
"""The command of the soak; a name follows."""

_WAYS_OUT = "tests/train/test_ways_out.py::test_"

ROWS: tuple[Row, ...] = (
    Row(
        "kill in save",
        "Of 200 `kill -9`, half of them aimed at a save, none leaves an unreadable checkpoint. "
        "What a killed start leaves goes at the next one.",
        (
            "tests/train/test_orphans.py",
            f"{_WAYS_OUT}two_hundred_kills",
            f"{_WAYS_OUT}a_checkpoint_that_fails_half_way_leaves_nothing",
        ),
    ),
    Row(
        "exact resume",
        "A run that was cut and goes on is the run that was not, by SHA-256, in every method, and "
        "with compiled updates.",
        (
            "tests/train/test_resume.py",
            "tests/train/test_compiled_resume.py",
            "tests/studies/test_work.py",
        ),
    ),
    Row(
        "disk full",
        "At 50 offsets of a save, and on a file system of 4 MiB with 25 sizes left, the old "
        "checkpoint loads; one line names the file; the run goes on.",
        ("tests/train/test_full_disk.py",),
    ),
    Row(
        "interruption",
        "SIGINT, SIGTERM and SIGHUP at 100 random times: codes 130, 143, 129, a checkpoint, and no "
        "traceback.",
        ("tests/cli/test_signals.py", "tests/train/test_interruption.py"),
    ),
    Row(
        "worker killed",
        "Of 24 runs on a Ray cluster of two nodes, of which a worker is killed every 20 s, and of "
        "240 on this machine, where everything is killed in the middle, each is done once, at most "
        "one interval of checkpoints (16,384 env-steps) is worked again, and weights, evaluations "
        "and report are those of an undisturbed study.",
        ("tests/studies/test_ledger.py", "tests/studies/test_killed.py"),
    ),
    Row(
        "non-finite loss",
        "An update with a loss or gradient that is not finite is named, and changes no weight, "
        "also where the actor fails after the critic has stepped.",
        ("tests/learn/test_divergence.py", "tests/train/test_divergence.py"),
    ),
    Row(
        "standard checkers",
        "Those of PettingZoo, Gymnasium and TorchRL pass, with warnings as errors.",
        (
            "tests/envs/test_pettingzoo.py",
            "tests/envs/test_gymnasium.py",
            "tests/envs/test_vector.py",
            "tests/envs/test_torchrl.py",
        ),
    ),
    Row(
        "truncated or flipped file",
        "1,000 cuts and 1,000 flipped bits of each file of a run give an error, never a run; 1,000 "
        "flipped bits of an archive change nothing that is read. 5,000 flipped bits of a footer "
        "end no process. A damaged run is not sealed.",
        (
            f"{_DAMAGE}no_cut_and_no_flipped_bit_is_read",
            "tests/experiments/test_seal.py",
            "tests/records/test_footer.py",
        ),
    ),
    Row(
        "malicious file",
        "Bombs, deep nesting, forged digests, links, pipes and code in files are refused.",
        (
            f"{_DAMAGE}what_is_no_plain_file_of_this_run_is_refused",
            f"{_DAMAGE}numbers_that_cannot_be_are_refused_though_nothing_is_sealed",
            f"{_DAMAGE}nothing_is_written_through_a_link",
            "tests/records/test_limits.py",
            "tests/config/test_untrusted.py",
            "tests/train/test_weights.py",
            "tests/test_security.py",
        ),
    ),
    Row(
        "NaN or infinite action",
        "It is refused, and no world moves.",
        (f"{_BATCH}refusals.py::test_bad_actions_move_nothing",),
        ("fuzz::steps",),
    ),
    Row(
        "wrong action id",
        "It is refused, read once, and no world moves.",
        (
            f"{_BATCH}refusals.py::test_bad_actions_move_nothing",
            "tests/envs/test_array_zoo.py::test_actions_are_read_once",
        ),
        ("fuzz::steps",),
    ),
    Row(
        "array zoo",
        "Each of over 100 arrays at each function has the same bits as the plain array, or is "
        "refused.",
        ("tests/envs/test_array_zoo.py",),
    ),
    Row(
        "num_envs extremes",
        "1 to 65,536 worlds do the same; what does not fit is a MemoryError.",
        (
            "tests/envs/test_extremes.py::test_batches_of_any_size_do_the_same",
            f"{_BATCH}failures.py::test_a_lack_of_memory_is_an_error_and_never_an_abort",
        ),
    ),
    Row(
        "panic in one world",
        "An exception names the world; all others have done the step.",
        (f"{_BATCH}failures.py",),
    ),
    Row(
        "soak",
        "Memory, threads and open files do not grow in 10⁸ env-steps with each engine and in an "
        "hour of training.",
        ("tests/benches/test_soak.py",),
        long=tuple(f"{SOAK} {part}" for part in ("discs", "rapier", "training")),
    ),
    Row(
        "thread count",
        "1, 2, 3, 8 and 16 threads give the same bytes.",
        (
            "tests/cross/test_digests.py",
            f"{_BATCH}env.py::test_threads_and_neighbours_change_no_byte",
        ),
        ("determinism::threads",),
    ),
    Row(
        "batch independence",
        "A world alone, in a batch, and beside other neighbours does the same.",
        (
            "tests/cross/test_digests.py",
            f"{_BATCH}env.py::test_threads_and_neighbours_change_no_byte",
        ),
        ("determinism::",),
    ),
    Row(
        "committed digests",
        "Fourteen scenarios do what `tests/cross/digests.json` says, optimised and with "
        "assertions: in all five situations, with faults, obstacles, services, deadlines, an order "
        "and areas of tasks, and with the nearest teammates alone.",
        ("tests/cross/test_digests.py",),
        ("digests::",),
        long=(ELSEWHERE,),
    ),
    Row(
        "tunnelling, escape",
        "Ten million env-steps with each engine: no robot leaves the arena or passes another. "
        "Overlaps stay below 5 % of a radius, and below 15 % where robots move as far in a substep "
        "as `rapier` takes. In random scenarios with keys of motion at their extremes, robots "
        "start apart, and overlaps stay below 15 % of the smaller radius with `rapier` and below "
        "5 % with `discs`. Masses beyond 16 : 1 are refused with `rapier`.",
        ("tests/envs/test_unequal_masses.py",),
        ("containment::", "extremes::", "speed::"),
    ),
    Row(
        "1 to 64 robots, 1 to 32 victims",
        "Random teams and waves: finite numbers, inside the arena, apart.",
        ("tests/envs/test_extremes.py::test_any_team_and_any_number_of_victims",),
    ),
    Row(
        "seed hygiene",
        "Random states of the process are left alone; neighbouring streams are independent by "
        "correlation and χ² over 20,000 worlds.",
        (
            "tests/envs/test_extremes.py::test_random_states_of_the_process_are_left_alone",
            "tests/envs/test_extremes.py::test_random_streams_are_independent",
        ),
    ),
    Row(
        "Rust against Python",
        "Worlds do what a plain stepper in Python does.",
        ("tests/cross/test_stepper.py",),
    ),
    Row(
        "parser fuzz",
        "Forged images, texts of scenarios and steps, a minute each: refused, or played.",
        (_FUZZ_SNAPSHOTS,),
        ("fuzz::",),
    ),
    Row(
        "two threads, use after close",
        "The second thread, a forked child and a closed batch get an error.",
        (
            f"{_BATCH}env.py::test_two_threads_in_one_environment_are_told",
            f"{_BATCH}env.py::test_a_forked_child_is_told_instead_of_hanging",
            f"{_BATCH}refusals.py::test_a_closed_environment_says_so",
        ),
    ),
)
"""In the order of the table."""
