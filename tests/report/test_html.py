"""HTML of tables and templates."""

import json

import pytest

from innerattn.report.html import fill, html_table, json_text
from innerattn.report.table import Row, Table, columns, section


def test_a_table_keeps_what_it_says() -> None:
    rows = [["a<b", "1"], Row(("mean",), strong=True)]
    table = Table(columns(["name"], ["n"]), (section(rows, "part & whole"),), "title", ("note",))
    text = html_table(table)
    assert "<caption>title</caption>" in text
    assert '<th colspan="2" scope="rowgroup">part &amp; whole</th>' in text
    assert '<th scope="row">a&lt;b</th><td class="number">1</td>' in text
    assert '<tr class="strong"><th scope="row">mean</th><td class="number"></td></tr>' in text
    assert text.endswith('<p class="quiet">note</p>')


def test_values_are_not_templates() -> None:
    assert fill("<@@a@@|@@b@@>", a="@@b@@", b="2") == "<@@b@@|2>"
    with pytest.raises(KeyError):
        fill("@@c@@", a="1")


def test_json_holds_no_tag() -> None:
    text = json_text({"a": "</script><!--"})
    assert "<" not in text
    assert json.loads(text) == {"a": "</script><!--"}
