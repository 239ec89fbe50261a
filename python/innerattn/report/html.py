"""HTML of tables, and filling of page templates; all text is escaped."""

from __future__ import annotations

import json
from html import escape
from importlib.resources import files

from innerattn.report.table import Column, Row, Table

_SHARED = files("innerattn.report") / "web"


def shared_text(*names: str) -> str:
    """Styles or scripts that several pages share, one after the other."""
    return "\n".join((_SHARED / name).read_text("utf-8") for name in names)


def fill(template: str, **values: str) -> str:
    """The template with each ``@@name@@`` replaced; values are taken as they are."""
    parts = template.split("@@")
    return "".join(values[part] if index % 2 else part for index, part in enumerate(parts))


def json_text(document: object) -> str:
    """JSON that no text in it can end the script element around it."""
    text = json.dumps(document, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c")


def html_table(table: Table) -> str:
    """A table as HTML, in a box that scrolls sideways; notes stand below it."""
    heads = "".join(_cell("th", column.head, column, ' scope="col"') for column in table.columns)
    title = f"<caption>{escape(table.title)}</caption>" if table.title else ""
    bodies = []
    for part in table.sections:
        rows = [_row(row, table.columns) for row in part.rows]
        if part.title:
            span = len(table.columns)
            rows.insert(
                0, f'<tr><th colspan="{span}" scope="rowgroup">{escape(part.title)}</th></tr>'
            )
        bodies.append(f"<tbody>{''.join(rows)}</tbody>")
    notes = "".join(f'<p class="quiet">{escape(note)}</p>' for note in table.notes)
    return (
        f'<div class="scroll" tabindex="0" role="group" aria-label="Table"><table>{title}'
        f"<thead><tr>{heads}</tr></thead>{''.join(bodies)}</table></div>{notes}"
    )


def _row(row: Row, columns: tuple[Column, ...]) -> str:
    cells = [*row.cells, *[""] * (len(columns) - len(row.cells))]
    first, *rest = zip(cells, columns, strict=True)
    shown = _cell("th", *first, ' scope="row"') + "".join(_cell("td", *one) for one in rest)
    strong = ' class="strong"' if row.strong else ""
    return f"<tr{strong}>{shown}</tr>"


def _cell(tag: str, text: str, column: Column, more: str = "") -> str:
    side = ' class="number"' if column.right else ""
    return f"<{tag}{side}{more}>{escape(text)}</{tag}>"
