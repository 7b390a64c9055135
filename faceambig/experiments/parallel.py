"""The same work on many subjects: in order, on one core or many machines, and taken up again where it was stopped.

The items are cut into chunks before anything knows how many processes there are, and each chunk is computed on one BLAS
thread, so that the numbers have the same bits on every backend. A finished chunk is kept in `settings.folder` under a
name made of all that decides its numbers: the code, the model, the function and its items.
"""

from __future__ import annotations

import gc
import hashlib
import os
import warnings
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from functools import lru_cache, partial
from importlib import import_module
from itertools import count, islice
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import shown, whole
from ..model import FaceModel
from .protocol import Progress, Settings, Step

Plain = str | float | int | bool | None
Item = TypeVar("Item")
Numbers = dict[str, NDArray[Any]]
Work = Callable[[FaceModel, Item], Mapping[str, ArrayLike]]
Chunk = list[Numbers]

RAY_AT_ONCE = 64  # chunks
COPIES = 8  # of the model that a worker lets pile up

_MODELS: dict[str, FaceModel] = {}  # of a worker: a model that came before is not kept twice
_SPARE_COPIES = count()


def over_subjects(
    function: Work[Item],
    items: Sequence[Item],
    settings: Settings,
    progress: Progress,
    *,
    what: str = "subjects",
    chunk: int = 1,
) -> list[Numbers]:
    """`function(settings.model, item)` for each item, in order; the same bits for every backend.

    Parameters
    ----------
    function: a function of a module, or `functools.partial` of one; gives named numbers or arrays.
    items: numbers, words, None, or tuples of these: with the function's name they are the name of a finished chunk.
    what: the items, for whoever waits.
    chunk: items that one process takes at a time; more where an item takes milliseconds.

    Raises
    ------
    ValueError: an item that is none of these, an unknown backend, or a backend that is not installed.
    """
    if whole("n_jobs", settings.n_jobs) == 0:
        raise ValueError("n_jobs: 0 is no number of processes; give 1 or more, or -1 for all cores")
    digest = model_digest(settings.model)
    chunks = [list(items[k : k + chunk]) for k in range(0, len(items), chunk)]
    files = [_file(settings.folder, function, part, digest) for part in chunks]
    found = [_kept(file) for file in files]
    left = [k for k, part in enumerate(found) if part is None]
    resumed = done = sum(len(part) for part in found if part is not None)
    most = 0
    progress(Step(what, done, len(items), resumed))
    for k, part, memory in _run(function, [(k, chunks[k]) for k in left], digest, settings):
        found[k] = part
        _keep(files[k], part)
        done, most = done + len(part), max(most, memory)
        progress(Step(what, done, len(items), resumed, most))
    return [numbers for part in found for numbers in part or []]


def _run(
    function: Work[Item], jobs: Sequence[tuple[int, list[Item]]], digest: str, settings: Settings
) -> Iterator[tuple[int, Chunk, int]]:
    """The chunks as they are done, with their numbers, and the memory of the process that made each."""
    model = settings.model
    if not jobs:
        return
    if settings.n_jobs == 1 and settings.backend == "loky":
        for k, part in jobs:
            yield _chunk(k, part, function, model)
        return
    joblib = _imported("joblib", "batch")
    with ExitStack() as stack:
        stack.enter_context(_backend(joblib, settings, stack))
        # loky ends a process whose caches have grown by 300 MB, and starts another: nothing is lost, nobody need know
        stack.enter_context(warnings.catch_warnings())
        warnings.filterwarnings(
            "ignore", "A worker stopped while some jobs were given", UserWarning
        )
        work = joblib.delayed(_chunk_of_worker)
        calls = (work(k, part, function, model, digest) for k, part in jobs)
        if settings.backend != "ray":
            parallel = joblib.Parallel(n_jobs=settings.n_jobs, return_as="generator_unordered")
            yield from parallel(calls)
            return
        # Ray's backend answers when all of a call is done: a few at a time, so that they are kept and progress is told
        while some := list(islice(calls, RAY_AT_ONCE)):
            yield from joblib.Parallel(n_jobs=settings.n_jobs)(some)


def _backend(joblib: Any, settings: Settings, stack: ExitStack) -> Any:
    """joblib's context of the backend asked for; what it opens is closed with `stack`."""
    if settings.backend == "loky":
        return joblib.parallel_config(backend="loky", inner_max_num_threads=1)
    if settings.backend == "dask":
        client = _dask_client(settings, stack)
        return joblib.parallel_config(backend="dask", client=client, scatter=[settings.model])
    if settings.backend == "ray":
        ray = _imported("ray", "ray")
        register = _imported("ray.util.joblib", "ray").register_ray
        if not ray.is_initialized():
            ray.init(address=settings.scheduler, log_to_driver=False, include_dashboard=False)
            stack.callback(ray.shutdown)
        register()
        return joblib.parallel_config(backend="ray")
    raise ValueError(f"backend: {shown(settings.backend)} is not loky, dask or ray")


def _dask_client(settings: Settings, stack: ExitStack) -> Any:
    distributed = _imported("dask.distributed", "dask")
    if settings.scheduler is not None:
        return stack.enter_context(distributed.Client(settings.scheduler))
    cores = os.cpu_count() or 1
    cluster = distributed.LocalCluster(
        n_workers=settings.n_jobs if settings.n_jobs > 0 else cores,
        threads_per_worker=1,
        host="127.0.0.1",
        dashboard_address="127.0.0.1:0",  # any free port: another cluster may run beside it
    )
    stack.enter_context(cluster)
    return stack.enter_context(distributed.Client(cluster))


def _imported(name: str, extra: str) -> Any:
    try:
        return import_module(name)
    except ImportError as error:
        raise ValueError(
            f"backend: {name} is not installed; pip install 'faceambig[{extra}]'"
        ) from error


def _chunk_of_worker(
    k: int, items: list[Item], function: Work[Item], model: FaceModel, digest: str
) -> tuple[int, Chunk, int]:
    """As `_chunk`, of a model that came with the task."""
    # What is kept by model, as rows of landmarks, needs always the same one
    kept = _MODELS.setdefault(digest, model)
    # Model and subjects hold each other: the copies stay until they are looked for, which costs 20 ms
    if kept is not model and next(_SPARE_COPIES) % COPIES == COPIES - 1:
        gc.collect()
    return _chunk(k, items, function, kept)


def _chunk(
    k: int, items: list[Item], function: Work[Item], model: FaceModel
) -> tuple[int, Chunk, int]:
    """The numbers of some items, on one BLAS thread."""
    with _threads().limit(limits=1):
        part = [
            {name: np.asarray(value) for name, value in function(model, item).items()}
            for item in items
        ]
    return k, part, _memory()


@lru_cache(maxsize=1)
def _threads() -> Any:
    """Of the BLAS in this process: sums in another order on more threads would have other bits."""
    return _imported("threadpoolctl", "batch").ThreadpoolController()


def _memory() -> int:
    """Most bytes this process has had in memory; 0 where the system does not say."""
    try:
        import resource
    except ImportError:
        return 0
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


@lru_cache(maxsize=8)
def model_digest(model: FaceModel) -> str:
    """Of all numbers of a model."""
    digest = hashlib.sha256()
    arrays = [model.mean, model.control_modes, model.faces]
    arrays += [subject.vertices for subject in model.subjects]
    arrays += [] if model.evaluation is None else [model.evaluation]
    for name, scheme in sorted(model.schemes.items()):
        digest.update(repr((name, scheme.eyes)).encode())
        arrays.append(scheme.vertices)
    for array in arrays:
        digest.update(repr((array.shape, str(array.dtype))).encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


@lru_cache(maxsize=1)
def code_digest() -> str:
    """Of this package's source: numbers of another version are not taken for those of this one."""
    digest = hashlib.sha256()
    root = Path(__file__).parents[1]
    for path in sorted(root.rglob("*.py")):
        digest.update(str(path.relative_to(root)).encode() + path.read_bytes())
    return digest.hexdigest()


def _file(folder: Path | None, function: Work[Item], items: list[Item], model: str) -> Path | None:
    name = repr((_told(function), [_plain(item) for item in items], model, code_digest()))
    if folder is None:
        return None
    return folder / f"{hashlib.sha256(name.encode()).hexdigest()[:32]}.npz"


def _told(function: Any) -> str:
    """A function and what it is given, in words that another run finds again."""
    if isinstance(function, partial):
        given = [_plain(value) for value in (*function.args, *sorted(function.keywords.items()))]
        return repr((_told(function.func), given))
    return f"{function.__module__}.{function.__qualname__}"


def _plain(value: object) -> object:
    """`value` if its repr tells all of it; ValueError otherwise: an array's repr does not."""
    if isinstance(value, tuple):
        return tuple(_plain(each) for each in value)
    if not isinstance(value, Plain):
        raise ValueError(f"items: {shown(value)} is not a number, a word, None or a tuple of these")
    return value


def _kept(file: Path | None) -> Chunk | None:
    """The numbers of a chunk that an earlier run finished."""
    if file is None or not file.is_file():
        return None
    try:
        with file.open("rb") as stream, np.load(stream, allow_pickle=False) as stored:
            part: Chunk = [{} for _ in range(int(stored["n"]))]
            for key in stored.files:
                k, _, name = key.partition(":")
                if name:
                    part[int(k)][name] = stored[key]
    except (OSError, ValueError, KeyError, zipfile.BadZipFile):
        return None  # damaged: computed again
    return part


def _keep(file: Path | None, part: Chunk) -> None:
    """Write a finished chunk in one piece: a run that is killed meanwhile leaves no half of it."""
    if file is None:
        return
    file.parent.mkdir(parents=True, exist_ok=True)
    arrays: dict[str, Any] = {
        f"{k}:{name}": value for k, numbers in enumerate(part) for name, value in numbers.items()
    }
    half = file.with_suffix(f".{os.getpid()}")
    with half.open("wb") as stream:
        np.savez(stream, n=np.array(len(part)), **arrays)
    half.replace(file)
