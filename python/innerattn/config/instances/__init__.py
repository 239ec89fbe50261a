"""Instances of multi-robot task allocation that others have published: model, reader and data."""

from innerattn.config.instances.instance import Instance, InstanceRobot, InstanceTask
from innerattn.config.instances.read import SHIPPED, named_instance, read_instances

__all__ = [
    "SHIPPED",
    "Instance",
    "InstanceRobot",
    "InstanceTask",
    "named_instance",
    "read_instances",
]
