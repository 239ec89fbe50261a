"""What a page may ask of its world. Forms are checked here; the world checks values."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from innerattn.config.untrusted import parse_json
from innerattn.evaluate.interactive import InteractiveWorld

Share = Annotated[float, Field(ge=-1.0, le=1.0)]


class _Message(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


class Look(_Message):
    """Nothing changes; the page is still there."""

    do: Literal["look"]

    def apply(self, world: InteractiveWorld) -> None:
        """Change nothing."""


class Step(_Message):
    """One control step."""

    do: Literal["step"]

    def apply(self, world: InteractiveWorld) -> None:
        """Do the step."""
        world.step()


class Restart(_Message):
    """The next episode, or episode 0 of a seed."""

    do: Literal["restart"]
    seed: Annotated[int, Field(ge=0, lt=2**53)] | None = None

    def apply(self, world: InteractiveWorld) -> None:
        """Begin it."""
        world.restart(self.seed)


class ChoosePolicy(_Message):
    """Another policy acts."""

    do: Literal["policy"]
    name: str = Field(max_length=1000)

    def apply(self, world: InteractiveWorld) -> None:
        """Let it act."""
        world.choose_policy(self.name)


class Steer(_Message):
    """A person drives a robot, or (none) nobody does."""

    do: Literal["steer"]
    robot: int | None
    x: Share = 0.0
    y: Share = 0.0

    def apply(self, world: InteractiveWorld) -> None:
        """Take over, or give back."""
        world.steer(self.robot, (self.x, self.y))


class MoveRobot(_Message):
    """A robot is put somewhere [m]."""

    do: Literal["move_robot"]
    robot: int
    x: float
    y: float

    def apply(self, world: InteractiveWorld) -> None:
        """Put it there."""
        world.move_robot(self.robot, self.x, self.y)


class PushRobot(_Message):
    """A robot is pushed: its velocity [m/s]."""

    do: Literal["push_robot"]
    robot: int
    vx: float
    vy: float

    def apply(self, world: InteractiveWorld) -> None:
        """Push it."""
        world.push_robot(self.robot, self.vx, self.vy)


class SetFaults(_Message):
    """Faults of a robot by kind."""

    do: Literal["faults"]
    robot: int
    values: dict[Annotated[str, Field(max_length=100)], float] = Field(max_length=20)

    def apply(self, world: InteractiveWorld) -> None:
        """Set them."""
        world.set_faults(self.robot, self.values)


class AddRobot(_Message):
    """A spare robot of a kind comes into the arena."""

    do: Literal["add_robot"]
    kind: str = Field(max_length=100)

    def apply(self, world: InteractiveWorld) -> None:
        """Let it in."""
        world.add_robot(self.kind)


class MoveVictim(_Message):
    """A victim is put somewhere [m]."""

    do: Literal["move_victim"]
    slot: int
    x: float
    y: float

    def apply(self, world: InteractiveWorld) -> None:
        """Put it there."""
        world.move_victim(self.slot, self.x, self.y)


class AddVictim(_Message):
    """A victim appears [m]."""

    do: Literal["add_victim"]
    task: Annotated[int, Field(ge=0, le=1000)]
    x: float
    y: float

    def apply(self, world: InteractiveWorld) -> None:
        """Let it appear."""
        world.add_victim(self.task, self.x, self.y)


class End(_Message):
    """The page is closed."""

    do: Literal["end"]

    def apply(self, world: InteractiveWorld) -> None:
        """Change nothing; the session ends."""


Message = (
    Look
    | Step
    | Restart
    | ChoosePolicy
    | Steer
    | MoveRobot
    | PushRobot
    | SetFaults
    | AddRobot
    | MoveVictim
    | AddVictim
    | End
)

_READER: TypeAdapter[Message] = TypeAdapter(Annotated[Message, Field(discriminator="do")])


def read_message(body: bytes) -> Message:
    """The message in a body of JSON.

    Raises:
        ValueError: it is no JSON, or no message; the text is one line that names the field.
    """
    try:
        return _READER.validate_python(parse_json(body))
    except ValueError as error:
        if not isinstance(error, ValidationError):
            raise ValueError(f"message: Invalid JSON: {' '.join(str(error).split())}") from None
        first = error.errors(include_url=False, include_input=False)[0]
        place = ".".join(str(part) for part in first["loc"])
        text = " ".join(first["msg"].split())
        raise ValueError(f"message: {place}: {text}" if place else f"message: {text}") from None
