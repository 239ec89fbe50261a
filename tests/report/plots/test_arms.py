"""Dots of arms: each row names its own arms, from top to bottom, and draws every run."""

from innerattn.report.plots.arms import ArmDots, ArmPanel, draw_arms


def arm(name: str, *values: float) -> ArmDots:
    return ArmDots(name, name == "inner", values, None)


def test_rows_may_have_different_arms() -> None:
    rows = [
        [ArmPanel("a", "score", (arm("inner", 0.1, 0.2), arm("uniform", 0.3), arm("oracle", 0.4)))],
        [ArmPanel("b", "score", (arm("inner", 0.5), arm("uniform", 0.6)))],
    ]
    figure = draw_arms(rows)
    assert len(figure.axes) == 2
    for panel, (drawn,) in zip(figure.axes, rows, strict=True):
        names = [one.name for one in drawn.arms]
        assert [label.get_text() for label in panel.get_yticklabels()] == names
        assert panel.get_ylim() == (len(names) - 0.4, -0.6)
        assert panel.get_title(loc="left") == drawn.situation
        dots = [list(line.get_xdata()) for line in panel.lines]
        assert dots == [list(one.values) for one in drawn.arms]
