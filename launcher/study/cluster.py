"""The jobs of a study on the workers of a Dask cluster, by joblib's backend for it.

Whoever can reach a Dask scheduler can run any code on its workers, and they on the client: a cluster is trusted.
"""

from __future__ import annotations

import asyncio
import io
import logging
import pickle
import platform
import warnings
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import CancelledError, Future
from contextlib import contextmanager
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

import launcher
from launcher.show import console
from launcher.study.store import code_digest, contents_digest
from trackfield.errors import RunFailed, ScenarioError
from trackfield.scenario import Scenario
from trackfield.scenario.packaged import packaged_data

try:
    import distributed
    from cloudpickle import Pickler
    from distributed.comm.addressing import parse_address, parse_host_port
    from joblib import parallel_config
    from joblib._dask import DaskDistributedBackend
except ImportError as error:
    lacking = f"--dask needs the package {error.name}, which is not installed; pip install 'trackfield[dask]' brings it"
    raise RunFailed(lacking) from None

_client: Any = distributed.Client  # parts of it have no types
_security: Any = distributed.Security
CONNECT_S: Final = 10.0
"""A scheduler that does not answer for so long is not there."""
WORKERS_S: Final = 10.0
"""A scheduler that has no worker for so long at the beginning has none."""
NOBODY_S: Final = 30.0
"""The work is given up if there is no worker for so long; lost ones may be replaced sooner."""
THREADS: Final = 1000
"""As many threads of a cluster have something to do at all times; joblib hands out two jobs for each."""
LOOKED_S: Final = 1.0
"""So often the scheduler is asked for its workers."""
_ASKED: Final = "__import__('launcher.study.cluster', fromlist=['here']).here()"
"""What tells which Trackfield is somewhere, also where there is none that could be called."""
_EXPECTED: Final = "that of a Dask scheduler, like tcp://127.0.0.1:8786"


@contextmanager
def cluster(address: str) -> Iterator[None]:
    """Inside, the jobs of ``parallel.unordered`` are computed by the workers of the scheduler at this address.

    Raises ``ScenarioError`` for what is no address, ``RunFailed`` if no scheduler answers there or it has no worker.
    Jobs inside raise ``RunFailed`` if the workers are lost for long, or are not as this process is.
    """
    with _quiet(), _connected(address) as client:
        backend = _Cluster(client, address)
        threads = client.ncores()
        console.print(f"computed by {len(threads)} workers with {sum(threads.values())} threads at {address}")
        with parallel_config(backend=backend):
            yield


@contextmanager
def _quiet() -> Iterator[None]:
    """Neither loggers nor warnings tell of lost connections what one message of ours tells, too."""
    before = logging.root.manager.disable
    logging.disable()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logging.disable(before)


@contextmanager
def _connected(address: str) -> Iterator[Any]:
    """A client of the scheduler, which has a worker."""
    _check_address(address)
    try:
        client = _client(address, timeout=CONNECT_S, set_as_default=False, name="trackfield")
    except OSError as error:
        raise RunFailed(f"no Dask scheduler answers at {address} ({error}); dask scheduler starts one") from None
    try:
        try:
            client.wait_for_workers(1, timeout=WORKERS_S)
        except TimeoutError:
            said = f"the Dask scheduler at {address} has no worker; dask worker {address} starts one"
            raise RunFailed(said) from None
        _check_same(client)
        yield client
    finally:
        client.close(timeout=CONNECT_S)


def _check_same(client: Any) -> None:
    """Raise ``RunFailed`` unless the scheduler and all workers have this Trackfield."""
    try:
        found = {"the scheduler": client.run_on_scheduler(eval, _ASKED)}
    except (ImportError, AttributeError) as error:
        found = {"the scheduler": error}
    found |= {f"the worker at {place}": told for place, told in client.run(eval, _ASKED, on_error="return").items()}
    for where, told in found.items():
        if told != here():
            said = f"no Trackfield, or an older one ({told})" if isinstance(told, Exception) else f"Trackfield {told}"
            raise RunFailed(f"{where} has {said}; expected {here()}, as here")


def _check_address(address: str) -> None:
    """Raise ``ScenarioError`` for what no scheduler can have."""
    try:
        scheme, place = parse_address(address)
        parse_host_port(place)
    except ValueError as error:
        raise ScenarioError(f"is {address!r} ({error})", key="--dask", expected=_EXPECTED) from None
    if scheme not in ("tcp", "tls"):
        raise ScenarioError(f"is {address!r}", key="--dask", expected=f"{_EXPECTED}, or tls://...")
    if scheme == "tls" and not _security().get_connection_args("client").get("ssl_context"):
        what = "has TLS, and the configuration of Dask names no certificates"
        expected = "its keys distributed.comm.tls, or the variables DASK_DISTRIBUTED__COMM__TLS__*, to name them"
        raise ScenarioError(what, key="--dask", expected=expected)


class _Cluster(DaskDistributedBackend):  # type: ignore[misc]  # joblib has no types
    """joblib's backend, which tells joblib nothing of jobs that are lost with their workers, and waits for them."""

    def __init__(self, client: Any, address: str) -> None:
        super().__init__(client=client)
        self._address = address
        self._callbacks_of: dict[Future[Any], Callable[[Any], None]] = {}

    def effective_n_jobs(self, n_jobs: int) -> int:
        """Many more than there are threads: workers may come later, and for one thread joblib would use no cluster."""
        return THREADS

    def start_call(self) -> None:
        """Begin to collect answers, and to look for workers."""
        super().start_call()
        self.client.loop.add_callback(self._watch)

    def submit(self, func: Any, callback: Callable[[Any], None]) -> Future[Any]:
        """Send a batch of jobs; the callback gets its answer, or what became of it."""
        code = here()
        func.items = [(_computed, (code, _packed(call)), {}) for call in func.items]
        future: Future[Any] = super().submit(func, callback)
        self._callbacks_of[future] = callback
        future.add_done_callback(self._done)
        return future

    def retrieve_result_callback(self, out: Any) -> Any:
        """The answers of a batch. Raises ``RunFailed`` for what the cluster could not do, and what the job raised."""
        if isinstance(out, BaseException):
            raise self._explained(out)
        return super().retrieve_result_callback(out)

    def _done(self, future: Future[Any]) -> None:
        callback = self._callbacks_of.pop(future)
        if error := future.exception():
            callback(error)

    async def _watch(self) -> None:
        """Fail what is waited for if there is nobody to do it."""
        loop = asyncio.get_running_loop()
        seen = loop.time()
        while self._continue:
            try:
                present = await self.client.scheduler.ncores()
            except OSError:
                present = {}
            seen = loop.time() if present else seen
            if loop.time() - seen > NOBODY_S:
                error = RunFailed(f"all workers of the Dask scheduler at {self._address} are gone")
                for callback in list(self._callbacks_of.values()):
                    callback(error)
                return
            await asyncio.sleep(LOOKED_S)

    def _explained(self, error: BaseException) -> BaseException:
        if isinstance(error, distributed.KilledWorker):
            died = error.allowed_failures + 1
            return RunFailed(f"{died} workers died one after the other while they did a job, for want of memory?")
        if isinstance(error, CancelledError):
            return RunFailed(f"the connection to the Dask scheduler at {self._address} was lost")
        return error


# --- what travels to a worker -----------------------------------------------------------------------------------------


class _Packer(Pickler):  # type: ignore[misc]  # cloudpickle has no types
    """Scenarios travel by their keys, and what their files have by its digest."""

    def reducer_override(self, thing: Any) -> Any:
        if isinstance(thing, Scenario):
            keys = thing.model_dump(mode="json", by_alias=True, exclude_unset=True)
            return _unpacked, (_portable(keys), contents_digest(thing))
        return super().reducer_override(thing)


def _packed(call: Any) -> bytes:
    stream = io.BytesIO()
    _Packer(stream).dump(call)
    return stream.getvalue()


def _portable(value: Any) -> Any:
    """The same, but files that come with Trackfield by their names alone: workers have them elsewhere."""
    if isinstance(value, Mapping):
        return {key: _portable(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_portable(item) for item in value]
    if isinstance(value, str) and (own := packaged_data(Path(value).name)) and str(own) == value:
        return own.name
    return value


def _unpacked(keys: Mapping[str, Any], digest: str) -> Scenario:
    """At a worker: the scenario. Raises ``RunFailed`` if a file that it names is another one here."""
    scenario = Scenario.load(keys)
    if contents_digest(scenario) != digest:
        said = "the files that the scenario names are not there, or have other contents, for the worker on"
        raise RunFailed(f"{said} {platform.node()}; expected the same files at the same paths as here")
    return scenario


def _computed(code: str, call: bytes) -> Any:
    """At a worker: call it. Raises ``RunFailed`` if Trackfield is another one here."""
    if code != here():
        raise RunFailed(f"a worker that came later, on {platform.node()}, has Trackfield {here()}; expected {code}")
    function, args, kwargs = pickle.loads(call)
    return function(*args, **kwargs)


@cache
def here() -> str:
    """Which Trackfield this is: its version, and a digest of its code and of numpy's version."""
    rest = sorted(Path(str(launcher.__file__)).parent.rglob("*.py"))
    return f"{version('trackfield')} ({code_digest(*rest)})"
