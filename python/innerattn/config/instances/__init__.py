"""Instances to be measured on: points of task allocation as others publish them, and worlds."""

from innerattn.config.instances.instance import Instance, InstanceRobot, InstanceTask
from innerattn.config.instances.read import (
    SHIPPED,
    named_instance,
    read_any,
    read_instances,
    read_worlds,
)
from innerattn.config.instances.world import Reference, WorldInstance

__all__ = [
    "SHIPPED",
    "Instance",
    "InstanceRobot",
    "InstanceTask",
    "Reference",
    "WorldInstance",
    "named_instance",
    "read_any",
    "read_instances",
    "read_worlds",
]
