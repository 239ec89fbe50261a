"""Arrays of a step go into other libraries without a copy."""

import os

import numpy as np
import pytest
import torch
from worlds import batch, plan

from innerattn.envs import Step

FIELDS = ("obs", "reward", "terminated", "truncated", "final_obs")


def stepped(copy: bool) -> Step:
    return batch(3, copy=copy).step(plan(1, 3)[0])


@pytest.mark.parametrize("copy", [True, False])
@pytest.mark.parametrize("field", FIELDS)
def test_torch_takes_the_very_memory(copy: bool, field: str) -> None:
    array = getattr(stepped(copy), field)
    tensor = torch.from_dlpack(array)
    assert tensor.data_ptr() == array.ctypes.data
    assert tuple(tensor.shape) == array.shape
    assert (tensor.numpy() == array).all()


def test_so_does_numpy_and_what_is_asked_of_a_batch() -> None:
    env = batch(3)
    for array in (env.state(), env.observe(), env.positions(), env.velocities()):
        assert np.from_dlpack(array).ctypes.data == array.ctypes.data
        assert torch.from_dlpack(array).data_ptr() == array.ctypes.data


def test_arrays_begin_where_jax_takes_them() -> None:
    kept = [getattr(stepped(True), field) for field in FIELDS for _ in range(9)]
    kept += [batch(count).state() for count in range(1, 9)]
    assert {array.ctypes.data % 64 for array in kept} == {0}
    assert all(array.flags.c_contiguous and array.flags.writeable for array in kept)


def test_an_array_of_ones_own_outlives_the_batch() -> None:
    env = batch(3)
    tensor = torch.from_dlpack(env.step(plan(1, 3)[0]).obs)
    kept = tensor.clone()
    for actions in plan(5, 3):
        env.step(actions)
    env.close()
    assert torch.equal(tensor, kept)


def test_jax_takes_the_very_memory_of_copies_and_refuses_views() -> None:
    if "INNERATTN_JAX_REQUIRED" not in os.environ:
        pytest.importorskip("jax")
    import jax.numpy as jnp

    own = [getattr(stepped(True), field) for field in FIELDS for _ in range(9)]
    own += [batch(count).state() for count in range(1, 9)]
    for array in own:
        assert jnp.from_dlpack(array).unsafe_buffer_pointer() == array.ctypes.data
    with pytest.raises(BufferError, match="readonly"):
        jnp.from_dlpack(stepped(False).obs)
