"""Random instances of task allocation, for tests that draw them."""

from hypothesis import strategies as st
from pydantic import ValidationError

from innerattn.config.instances import Instance


@st.composite
def instances(draw: st.DrawFn, robots: int = 6, tasks: int = 6) -> Instance:
    """A team that can do all tasks; some robots have several skills."""
    place = st.tuples(st.floats(-2, 2), st.floats(-2, 2))
    skill = st.integers(0, 2)
    robot = st.fixed_dictionaries({"depot": place, "skills": st.lists(skill, max_size=3)})
    needs = st.lists(skill, min_size=1, max_size=3)
    task = st.fixed_dictionaries(
        {"position": place, "skills": needs, "duration": st.floats(0, 3) | st.just(0.0)}
    )
    table = {
        "name": "drawn",
        "speed": draw(st.floats(0.1, 3)),
        "robots": draw(st.lists(robot, min_size=1, max_size=robots)),
        "tasks": draw(st.lists(task, min_size=1, max_size=tasks)),
    }
    try:
        return Instance.model_validate(table)
    except ValidationError:
        all_skills = {"depot": (0.0, 0.0), "skills": [0, 1, 2]}
        return Instance.model_validate(table | {"robots": [all_skills] * 3})
