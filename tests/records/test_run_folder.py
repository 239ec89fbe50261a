"""What ``run.json`` says, also where an older version wrote it."""

import pytest

from innerattn.records.run_folder import run_info

DOCUMENT = {
    "schema_version": 1,
    "versions": {"torch": "2.15.0"},
    "seed": 0,
    "commit": None,
    "threads": 1,
    "device": "cpu",
    "state": "done",
    "env_steps": 300_032,
    "updates": 11_962,
    "seconds": 369.557,
}


def test_keys_that_had_another_name_are_read() -> None:
    info = run_info({**DOCUMENT, "products": "onednn, error 4.2e-07"})
    assert info.matmul_backend == "onednn, error 4.2e-07"
    assert info == run_info({**DOCUMENT, "matmul_backend": "onednn, error 4.2e-07"})


def test_keys_that_came_later_have_defaults() -> None:
    info = run_info(DOCUMENT)
    assert (info.matmul_backend, info.warm_start, info.weights_sha256) == ("default", "none", None)
    assert info.compiled is False


@pytest.mark.parametrize(
    ("document", "message"),
    [
        ([], "not the record of a run"),
        ({}, "not the record of a run"),
        ({**DOCUMENT, "unheard": 1}, "not the record of a run"),
        ({**DOCUMENT, "schema_version": 2}, "schema version 2, only 1 is known"),
        ({**DOCUMENT, "state": "?"}, "state '\\?' is not one of"),
    ],
)
def test_what_is_no_record_of_a_run_is_refused(document: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        run_info(document)
