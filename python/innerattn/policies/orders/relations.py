"""How the tasks of an instance are related, which does not change while an order is made."""

from __future__ import annotations

from collections import Counter

import numpy as np
from numpy.typing import NDArray

from innerattn.config.instances import Instance

RELATIONS = 2
"""Numbers that are known of a pair of tasks."""


def relations_of(instance: Instance) -> NDArray[np.float32]:
    """What is known of each pair of tasks (T, T, 2), for a policy that compares them.

    The first number is the way between them, in mean ways of the instance. The second says how
    alike their needs are: the cosine of their numbers of robots by skill, from 0 to 1.
    """
    places = np.array([task.position for task in instance.tasks])
    ways = np.linalg.norm(places[:, None] - places, axis=-1)
    if ways.any():
        ways /= ways.mean()
    skills = sorted({skill for task in instance.tasks for skill in task.skills})
    counts = [Counter(task.skills) for task in instance.tasks]
    needs = np.array([[count[skill] for skill in skills] for count in counts], dtype=float)
    needs /= np.linalg.norm(needs, axis=1, keepdims=True)
    return np.stack([ways, needs @ needs.T], axis=-1).astype(np.float32)
