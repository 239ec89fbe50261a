"""The pages about studies show what their commands make of the archived runs, and are short."""

import csv
import math
import re
import shutil
from pathlib import Path

import pytest
from markdown_rows import rows_of
from once import made_once

from innerattn.cli.main import main
from innerattn.experiments.archive import FILE, read_archive
from innerattn.report.marks import marked
from innerattn.report.study.publish import publish
from innerattn.studies.folder import open_study
from innerattn.studies.results import read_results
from innerattn.studies.shipped import shipped_table

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
RECORDS = DOCS / "records"
PAGES = ("reproduction", "paper_protocol", "crossed")
NEEDS_STEPS = ("## Fig. 4: ", "## Fig. 5: ")
NOT_RUN = re.compile(r"mixed-(8|16) .*|double .* (helpers|team)\S*, seed [3-9]")
"""Runs of a command's plan that its page says have not been run."""


def page(name: str) -> str:
    return (DOCS / f"{name}.md").read_text("utf-8")


def part(name: str, section: str) -> str:
    """What the command made of a page."""
    text = page(name).split(f"<!-- {section}: begin -->")[1]
    return text.split(f"<!-- {section}: end -->")[0].strip()


def empty(path: Path, name: str) -> None:
    """Take the text out of a part of a page."""
    before, _, after = marked(path, name)
    path.write_text(before + after, "utf-8")


def make(words: list[str], archive: Path, pool: Path) -> Path:
    """Report on the archived runs, all of the plan but those that have not been run."""
    shutil.copyfile(archive, pool / FILE)
    code = main(["reproduce", *words, "--report-only", "--out", str(pool)])
    study = pool / words[0]
    missing = [run for run, _ in read_results(open_study(study)).left_out]
    assert code == bool(missing)
    assert all(NOT_RUN.match(str(run)) for run in missing)
    return study


def words_of(name: str) -> list[str]:
    """Target and options of the command on a page."""
    (command,) = re.findall(r"^innerattn (reproduce .*)$", page(name), flags=re.MULTILINE)
    target, *options = command.removeprefix("reproduce ").replace(" --report-only", "").split()
    return [{"all": "table2"}.get(target, target), *options]  # what else there is needs steps


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Folders of the studies, as the commands on the pages make them of the archives."""

    def make_all(pools: Path) -> None:
        for name in PAGES:
            (pools / name).mkdir()
            make(words_of(name), RECORDS / f"{name}.parquet", pools / name)

    pools = made_once(tmp_path_factory, "published_studies", make_all)
    return {name: pools / name / words_of(name)[0] for name in PAGES}


def made_sections(name: str, folder: Path, docs: Path) -> tuple[str, str]:
    """What a report puts into the empty parts of its page."""
    (docs / f"{name}.md").write_text(
        "".join(f"<!-- {one}: begin -->\n<!-- {one}: end -->\n" for one in ("summary", "details"))
    )
    report = folder / ("crossed.md" if name == "crossed" else "report.md")
    publish(open_study(folder), report, [], docs)
    summary, details = (marked(docs / f"{name}.md", one)[1] for one in ("summary", "details"))
    return summary.strip(), details.strip()


def cells_fit(made: list[str], shown: list[str]) -> bool:
    """Whether a row is that of the page, where it does not need steps."""
    return len(made) == len(shown) and all(
        a in (b, "–", "**–**") for a, b in zip(made, shown, strict=True)
    )


@pytest.mark.long
@pytest.mark.parametrize(
    ("target", "budget", "options"),
    [
        ("swapped", "short", "--seeds 10 --presets single,mixed"),
        ("learning-ablations", "fast", "--seeds 3"),
        ("attention", "fast", "--seeds 10 --presets mixed,mixed-8,mixed-16"),
        (
            "attention",
            "strong",
            "--seeds 10 --presets mixed,mixed-8 --methods ppo-inner,ppo-uniform,mappo",
        ),
        ("learning", "strong", "--methods ppo-inner --seeds 5"),
        ("learning-long", "strong", "--seeds 5"),
        ("learning-afterstates", "strong", "--seeds 5"),
        (
            "learning-warm-start",
            "strong",
            "--methods ppo-inner --seeds 3 --presets single,mixed",
        ),
    ],
)
def test_tables_are_made_of_the_archive(
    target: str, budget: str, options: str, tmp_path: Path
) -> None:
    pages = shipped_table(target)["report"]["pages"]
    (asked,) = [one for one in pages if one["budget"] == budget]
    archive, docs = DOCS / asked["archive"], tmp_path / "docs"
    words = [target, "--budget", budget, *options.split()]
    assert f"innerattn reproduce {' '.join(words)}" in page(Path(asked["page"]).stem)
    docs.mkdir()
    shutil.copy(DOCS / asked["page"], docs)
    empty(docs / asked["page"], asked["part"])
    make([*words, "--publish", str(docs)], archive, tmp_path)
    assert (docs / asked["page"]).read_text("utf-8") == page(Path(asked["page"]).stem)
    of_study, published = read_archive(docs / asked["archive"]), read_archive(archive)
    digests = {one.folder.name: one.config_sha256 for one in published}
    assert of_study
    assert all(digests[one.folder.name] == one.config_sha256 for one in of_study)


@pytest.mark.long
@pytest.mark.parametrize("name", PAGES)
def test_pages_show_what_is_made_of_the_archive(
    name: str, made: dict[str, Path], tmp_path: Path
) -> None:
    summary, details = made_sections(name, made[name], tmp_path)
    shown = part(name, "details")
    if name == "crossed":
        assert (summary, details) == (part(name, "summary"), shown)
        return
    rows = rows_of(part(name, "summary"))
    assert rows_of(summary)[0] == rows[0]
    assert all(row in rows for row in rows_of(summary))
    by_heading = {text.split("\n")[0]: text for text in re.split("^## ", shown, flags=re.M)[1:]}
    of_archive = re.split("^## ", details, flags=re.M)[1:]
    assert len(of_archive) == 5
    for text in of_archive:
        assert by_heading.pop(text.split("\n")[0]).strip() == text.strip()
    assert [f"## {name}".startswith(NEEDS_STEPS) for name in by_heading] == [True, True]


@pytest.mark.long
@pytest.mark.parametrize("name", PAGES)
def test_linked_tables_are_those_of_the_archive(name: str, made: dict[str, Path]) -> None:
    linked = re.findall(rf"\(tables/{name}/([^)]+)\)", page(name))
    assert {path.name for path in (DOCS / "tables" / name).iterdir()} == set(linked)
    for file in set(linked) - {"fig5_evidence.md"}:
        text = (made[name] / file).read_text("utf-8")
        shown = (DOCS / "tables" / name / file).read_text("utf-8")
        if file.endswith(".csv"):
            same_values(text, shown)
            continue
        there = rows_of(shown)
        missing = [row for row in rows_of(text) if not any(cells_fit(row, one) for one in there)]
        assert missing == [], file
        if file != "claims.md":
            assert len(there) == len(rows_of(text))


def same_values(made: str, shown: str) -> None:
    """Equal tables; the last digits of numbers are those of a library."""
    made_rows, shown_rows = (list(csv.reader(text.splitlines())) for text in (made, shown))
    assert len(made_rows) == len(shown_rows) > 1
    for made_row, shown_row in zip(made_rows, shown_rows, strict=True):
        for a, b in zip(made_row, shown_row, strict=True):
            assert a == b or math.isclose(float(a), float(b), rel_tol=1e-9)


@pytest.mark.parametrize("name", PAGES)
def test_the_archived_runs_are_those_that_are_listed(name: str) -> None:
    archived = {run.folder.name for run in read_archive(RECORDS / f"{name}.parquet")}
    file = "crossed.csv" if name == "crossed" else "runs.csv"
    lines = (DOCS / "tables" / name / file).read_text("utf-8").splitlines()
    assert archived == {Path(row["folder"]).name for row in csv.DictReader(lines)}


@pytest.mark.parametrize("name", PAGES)
def test_a_page_opens_with_its_answer_and_one_figure_or_table(name: str) -> None:
    text = page(name)
    assert len(text.split()) < 2_500
    opening, rest = text.split("\n## ", 1)
    assert rest.startswith("How it was measured\n")
    answer = opening.split("<!-- summary: begin -->")[0].split("\n", 1)[1]
    assert 1 <= len(re.findall(r"[.?!](?=\s)", answer)) <= 3
    assert (len(rows_of(opening)) - 1 in range(1, 9)) != ("![" in opening)
    for target in re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", text):
        assert target.startswith("https://") or (DOCS / target).exists(), target


def test_the_answer_about_seeds_is_what_was_measured() -> None:
    answer = page("crossed").split("<!-- summary: begin -->")[0]
    rows = {tuple(row[:2]): row[4] for row in rows_of(part("crossed", "details")) if len(row) == 6}
    for situation in ("single", "mixed"):
        correlation = rows[situation, "team"].split(" ")[0]
        assert f"{correlation} in {situation}" in answer


@pytest.mark.long
def test_the_table_of_learning_is_made_of_the_same_runs(tmp_path: Path) -> None:
    study = make(["learning", "--budget", "short"], RECORDS / "reproduction.parquet", tmp_path)
    text = (study / "report.md").read_text("utf-8")
    found = {one.partition("\n")[0]: one for one in re.split("^## ", text, flags=re.M)}
    shown = rows_of(part("learning", "learning_short"))
    assert [*rows_of(found["Scores"]), *rows_of(found["Contrasts"])] == shown
    assert len(shown) == 1 + 12 + 2 * (1 + 6)
