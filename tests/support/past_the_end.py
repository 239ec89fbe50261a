"""Reads the byte after a lent array, which the address sanitizer must notice; `make test-asan`."""

import ctypes

from innerattn.config import Scenario
from innerattn.envs import BatchEnv

with BatchEnv(Scenario(), 3, copy=False) as env:
    obs = env.reset()
    print(len(ctypes.string_at(obs.ctypes.data, obs.nbytes)), "bytes are there", flush=True)
    # A single byte would be read by Python itself, which nobody watches; more are copied by
    # `memcpy`, which is watched.
    ctypes.string_at(obs.ctypes.data, obs.nbytes + 1)
    print("nobody noticed the byte after them")
