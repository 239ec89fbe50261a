"""Tables in Markdown, read back by a few plain rules."""

import re


def rows_of(text: str) -> list[list[str]]:
    """The cells of all table rows of a text, heads included, rules left out."""
    lines = [line for line in text.splitlines() if line.startswith("|")]
    cells = [re.split(r"(?<!\\)\|", line)[1:-1] for line in lines]
    rows = [[cell.strip().replace("\\|", "|") for cell in row] for row in cells]
    return [row for row in rows if not all(re.fullmatch("-+:?", cell) for cell in row)]
