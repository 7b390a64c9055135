"""faceambig reproduce: the paper's tables and figures, each by its name, with a report that says which claims hold."""

from __future__ import annotations

import argparse
import shutil
import sys
import time
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

from .shared import GOOD, NOT_CONVERGED, say_or_print, version, written_lines

if TYPE_CHECKING:
    from pathlib import Path

    from faceambig.experiments.protocol import Outcome, Settings, Step

    from ..reports.report import Done

OUT = "faceambig-report"
UNFINISHED = "unfinished"  # folder in OUT: what a run that was stopped had finished
EVERY = 0.2  # seconds between two states of the line
BACKENDS = ("loky", "dask", "ray")


def add(command: argparse.ArgumentParser) -> None:
    """Its flags."""
    command.add_argument("names", nargs="*", metavar="NAME", help="table3, fig4a, ..., or all")
    command.add_argument("--list", action="store_true", help="say what there is, and run nothing")
    command.add_argument(
        "--model", default="embedded", help="embedded, ict or a path (default embedded)"
    )
    command.add_argument(
        "--subjects", type=int, metavar="N", help="how many people (default: the experiment's own)"
    )
    command.add_argument(
        "--seed", type=int, default=0, help="of everything that is drawn (default 0)"
    )
    command.add_argument(
        "--quick", action="store_true", help="few people, coarse grids: the trends in a minute"
    )
    command.add_argument(
        "--backend",
        choices=BACKENDS,
        default="loky",
        help="what spreads the work: processes of this machine, Dask or Ray (default loky)",
    )
    command.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="of a Dask scheduler or a Ray head; else this machine",
    )
    command.add_argument(
        "--jobs",
        type=int,
        metavar="N",
        help="processes (default: one for each core; 1 with --quick)",
    )
    command.add_argument(
        "--out", default=OUT, metavar="DIR", help=f"folder of report and files (default {OUT})"
    )
    command.add_argument(
        "--regressor", metavar="MODEL.onnx", help="a learned one to judge beside the fits"
    )
    command.add_argument(
        "--archive",
        metavar="FILE",
        help="published photographs, for the experiments that know them",
    )
    command.add_argument("--json", action="store_true", help="print JSON for programs")


def run(options: argparse.Namespace) -> int:
    """Run what is named, one after the other, and write the report; 1 if one of several could not be run."""
    from pathlib import Path

    from faceambig.experiments import NAMES

    if options.list:
        return _list(options)
    if not options.names:
        raise ValueError(f"NAME: none given; say all, or some of {', '.join(NAMES)}")
    names = _chosen(options.names)
    out = Path(options.out)
    settings = _settings(options, out)
    out.mkdir(parents=True, exist_ok=True)
    done = [_one(name, settings, alone=len(names) == 1) for name in names]
    files = _write(out, done, settings)
    shutil.rmtree(out / UNFINISHED, ignore_errors=True)
    record = {
        "experiments": [_record(each) for each in done],
        "files": files,
        "version": version(),
    }
    lines = [*_lines(done), *written_lines(files)]
    say_or_print(options, record, lines)
    return GOOD if all(each.outcome is not None for each in done) else NOT_CONVERGED


def _list(options: argparse.Namespace) -> int:
    from faceambig.experiments import NAMES, experiment

    table = [experiment(name) for name in NAMES]
    record = {"experiments": [{"name": e.name, "paper": e.paper, "title": e.title} for e in table]}
    say_or_print(options, record, [f"{e.name:<10} {e.paper:<24} {e.title}" for e in table])
    return GOOD


def _chosen(names: Sequence[str]) -> list[str]:
    """The experiments named, each once, in the order of the report."""
    from faceambig.experiments import NAMES

    for name in names:
        if name != "all" and name not in NAMES:
            raise ValueError(f"NAME: {name!r} is not all or one of {', '.join(NAMES)}")
    return [name for name in NAMES if "all" in names or name in names]


def _settings(options: argparse.Namespace, out: Path) -> Settings:
    import os
    from importlib.util import find_spec

    from faceambig import load_model
    from faceambig.experiments.protocol import Settings

    if options.subjects is not None and options.subjects < 2:
        raise ValueError(f"--subjects: {options.subjects} is not at least 2")
    if options.seed < 0:
        raise ValueError(f"--seed: {options.seed} is negative")
    if options.scheduler is not None and options.backend == "loky":
        raise ValueError("--scheduler: loky has none; give --backend dask or ray with it")
    if out.exists() and not out.is_dir():
        raise ValueError(f"--out: {str(out)!r} is a file, not a folder")
    jobs = options.jobs
    if jobs is None:
        alone = options.quick and options.backend == "loky"
        jobs = 1 if alone or find_spec("joblib") is None else os.cpu_count() or 1
    extra = {name: getattr(options, name) for name in ("regressor", "archive")}
    return Settings(
        model=load_model(options.model),
        model_name=options.model,
        n_subjects=options.subjects,
        seed=options.seed,
        quick=options.quick,
        backend=options.backend,
        n_jobs=jobs,
        scheduler=options.scheduler,
        folder=out / UNFINISHED,
        extra={name: value for name, value in extra.items() if value is not None},
    )


def _one(name: str, settings: Settings, *, alone: bool) -> Done:
    """One experiment. What the model lacks for it is said in the report, unless it is all that was asked for."""
    from faceambig.experiments import experiment

    from ..reports.report import Done

    asked = experiment(name)
    with TimeLeft(name) as progress:
        try:
            return Done(asked, asked.run(settings, progress))
        except ValueError as error:
            if alone:
                raise
            return Done(asked, None, " ".join(str(error).split()))


def _write(out: Path, done: Sequence[Done], settings: Settings) -> list[str]:
    """All files or none; their names."""
    from ..files import write_all
    from ..reports.report import drawn, files_of, html

    pictures = {each.outcome.name: drawn(each.outcome) for each in done if each.outcome}
    inside: dict[str, bytes] = {}
    for each in done:
        if each.outcome is not None:
            inside |= files_of(each.outcome, pictures[each.outcome.name])
    inside["report.html"] = html(done, pictures, _asked(settings)).encode()
    write_all({out / name: data for name, data in inside.items()})
    return [str(out / name) for name in inside]


def _asked(settings: Settings) -> dict[str, str]:
    """What was run, for the head of the report: nothing that two runs of the same would say differently."""
    model = settings.model
    asked = {
        "model": f"{settings.model_name}: {model.n_vertices} vertices, {model.n_modes} modes",
        "seed": str(settings.seed),
        "size": "quick: trends, not numbers" if settings.quick else "as in the paper where it says",
        "version": version(),
    }
    return asked | dict(settings.extra)


def _record(done: Done) -> dict[str, Any]:
    from ..reports.report import record_of

    if done.outcome is None:
        return {"name": done.experiment.name, "failure": done.failure}
    return record_of(done.outcome)


def _lines(done: Sequence[Done]) -> Iterator[str]:
    for each in done:
        yield f"{each.experiment.paper}: {each.experiment.title}"
        if each.outcome is None:
            yield f"  not run: {each.failure}"
        else:
            yield from _claim_lines(each.outcome)


def _claim_lines(outcome: Outcome) -> Iterator[str]:
    from ..reports.report import verdict

    for claim in outcome.claims:
        yield f"  {verdict(claim)}: {claim.words}"
        yield f"    the paper {claim.paper}; here {claim.ours}"


class TimeLeft:
    """Progress with the time left, and the memory of a process; one line on stderr that only a terminal sees."""

    def __init__(self, name: str) -> None:
        self._name, self._shown = name, 0
        self._what, self._begun, self._next = "", 0.0, 0.0

    def __call__(self, step: Step) -> None:
        now = time.perf_counter()
        if step.what != self._what or step.done == step.resumed:
            self._what, self._begun = step.what, now
        if not sys.stderr.isatty() or now < self._next:
            return
        self._next = now + EVERY
        line = f"{self._name}: {told(step, now - self._begun)}"
        sys.stderr.write(f"\r{line:<{self._shown}}")
        sys.stderr.flush()
        self._shown = len(line)

    def __enter__(self) -> TimeLeft:
        return self

    def __exit__(self, *_: object) -> None:
        if self._shown:
            sys.stderr.write(f"\r{'':<{self._shown}}\r")
            sys.stderr.flush()


def told(step: Step, seconds: float) -> str:
    """How far a run is after so many seconds, in words."""
    new = step.done - step.resumed
    words = [f"{step.what} {step.done} of {step.total}"]
    if step.resumed:
        words.append(f"{step.resumed} from before")
    if new:
        left = seconds / new * (step.total - step.done)
        words.append(f"{left:.0f} s left" if left < 120 else f"{left / 60:.0f} min left")
    if step.worker_bytes:
        words.append(f"{step.worker_bytes / 1e6:.0f} MB a process")
    return ", ".join(words)
