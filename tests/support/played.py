"""`innerattn play`'s server in this process, for tests of its page."""

import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager

from innerattn.config import Scenario
from innerattn.evaluate.interactive import InteractiveWorld, endless
from innerattn.policies import Policy, scripted_policy
from innerattn.report.local_server import LocalServer
from innerattn.report.play.page import play_pages
from innerattn.report.play.sessions import Sessions


def scripted_world(scenario: Scenario | None = None, *names: str) -> Callable[[], InteractiveWorld]:
    """Makes worlds in which scripts act."""
    worlds = endless(scenario or Scenario.preset("mixed"))

    def make() -> InteractiveWorld:
        scripts = names or ("hungarian", "greedy")
        policies: Mapping[str, Policy] = {name: scripted_policy(name, worlds) for name in scripts}
        return InteractiveWorld(worlds, policies, 7)

    return make


@contextmanager
def played(
    make: Callable[[], InteractiveWorld], name: str = "team", beside: str = ""
) -> Iterator[LocalServer]:
    """A server of such worlds."""
    server = LocalServer(play_pages(name, beside), take=Sessions(make).take)
    thread = threading.Thread(target=server.serve)
    thread.start()
    try:
        yield server
    finally:
        server.close()
        thread.join()
