"""The command line. No logic: every command is one call, and an exit code with one meaning (`benchharness.exits`)."""

from __future__ import annotations

import errno
import signal
import sys
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, NoReturn

import typer
from rich.console import Console
from rich.markup import escape

from benchharness import __version__, platform
from benchharness.exits import Exit

TABLES = Path("results")
BASELINES = TABLES / "baselines"
EXHAUSTED = (errno.ENOSPC, errno.EDQUOT, errno.EIO, errno.EROFS, errno.EMFILE, errno.ENFILE, errno.ENOMEM, errno.ENOLCK)
"""What no other input mends: the disk is full or broken, too many files are open, there are no locks."""

Study = Annotated[Path, typer.Argument(metavar="CONFIG", help="the study: a TOML file, or a name that `list configs` shows")]
Out = Annotated[Path | None, typer.Option(help="run folder; a new one under results/runs if not given")]
Only = Annotated[list[str] | None, typer.Option(metavar="METHOD", help="run this method; may be repeated")]
Plugin = Annotated[list[str] | None, typer.Option(metavar="FILE[:NAME]", help="add the method of a file; may be repeated")]
Resume = Annotated[bool, typer.Option("--resume", help="take up a run that was interrupted")]
Yes = Annotated[bool, typer.Option("--yes", help="begin, though it may take more than an hour")]
RunFolder = Annotated[Path, typer.Argument(help="a run folder")]

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="Compares ways to render what a curved mirror shows: speed against accuracy, and where each breaks.",
)


def _version(wanted: bool) -> None:
    if wanted:
        print(f"benchharness {__version__}")
        raise typer.Exit(Exit.FINE)


@app.callback()
def command(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="say which version this is, and end")
    ] = False,
) -> None:
    pass


@app.command()
def run(
    config: Study,
    out: Out = None,
    only: Only = None,
    plugin: Plugin = None,
    resume: Resume = False,
    yes: Yes = False,
    cluster: Annotated[str | None, typer.Option(metavar="ADDRESS", help="a distributed scheduler")] = None,
) -> None:
    """Render, measure and report a study."""

    def action() -> int:
        from benchharness import report
        from benchharness.execution import progress, runner
        from benchharness.study import config as configs
        from benchharness.study import plugins, shipped
        from benchharness.tables import origin

        console, file = Console(), shipped.config(config)
        with progress.listener(console) as listener:
            study = configs.load(file, plugin or (), only or (), listener.note)
            code, folder = runner.run(study, out, listener, resume=resume, yes=yes, cluster=cluster)
        origin.write_command(folder, file, [plugins.absolute(spec, Path.cwd()) for spec in plugin or ()])
        print(report.write(folder))
        return code

    _exit(action)


@app.command()
def stability(
    config: Annotated[
        Path | None, typer.Argument(help="further settings: a TOML file, or a name; everything there is if not given")
    ] = None,
    out: Out = None,
    only: Only = None,
    plugin: Plugin = None,
    study: Annotated[list[str] | None, typer.Option(help="atlas, motion or perturbation; may be repeated")] = None,
    regime: Annotated[list[str] | None, typer.Option(metavar="NAME", help="run this regime; may be repeated")] = None,
    severity: Annotated[float | None, typer.Option(help="run this severity")] = None,
    scene: Annotated[list[str] | None, typer.Option(help="of motion and perturbation; may be repeated")] = None,
    resume: Resume = False,
    yes: Yes = False,
) -> None:
    """Drive every method to where it fails; see whether it says so."""

    def action() -> int:
        from benchharness import stability
        from benchharness.report import matrix
        from benchharness.study import shipped

        wanted = stability.Wanted(plugin or (), only or (), study or (), regime or (), severity, scene or ())
        outcome = stability.run(out, config and shipped.config(config), wanted, resume=resume, yes=yes)
        print(f"{matrix.write(outcome.folder)}: {outcome.silent} rows fail silently")
        return outcome.code

    _exit(action)


@app.command()
def speed(
    out: Out = None,
    size: Annotated[tuple[int, int], typer.Option(metavar="W H", help="pixels")] = (720, 512),
    frame: Annotated[int, typer.Option(help="of the kitchen; at 62 the bowl fills a quarter")] = 62,
    detail: Annotated[str, typer.Option(help="lean or paper")] = "paper",
    rounds: Annotated[int, typer.Option(help="how often everything is timed")] = 60,
    vertices: Annotated[bool, typer.Option("--vertices", help="also: time and error against the number of vertices")] = False,
    iterations: Annotated[bool, typer.Option("--iterations", help="also: steps that reflection points take")] = False,
    impostors: Annotated[bool, typer.Option("--impostors", help="also: a paper's tables of impostors, beside ours")] = False,
    complexity: Annotated[bool, typer.Option("--complexity", help="also: time and error against the mirror's shape")] = False,
) -> None:
    """Time stages and whole frames against Embree and llvmpipe."""

    def action() -> int:
        from benchharness.execution import folder
        from benchharness.report import speed as charts
        from benchharness.speed import sitting

        place = out or folder.stamped("speed")
        more = {"vertices": vertices, "iterations": iterations, "impostors": impostors, "complexity": complexity}
        sitting.speed(place, size, frame, detail, rounds, Console(), **more)
        charts.write(place)
        return Exit.FINE

    _exit(action)


@app.command()
def needs(
    scene: Annotated[list[str] | None, typer.Argument(metavar="[SCENE]...", help="of the config; all if not given")] = None,
    config: Annotated[Path, typer.Option(help="a TOML file as of `run`, or a name; your own scenes too")] = Path("needs"),
    out: Out = None,
    only: Only = None,
    plugin: Plugin = None,
) -> None:
    """Say how little model is enough: vertices, texels, maps."""

    def action() -> int:
        from benchharness.execution import folder
        from benchharness.needs import study
        from benchharness.report import needs as page
        from benchharness.study import config as configs
        from benchharness.study import shipped

        loaded = configs.load(shipped.config(config), plugin or (), only or ())
        place = out or folder.stamped("needs")
        study.run(loaded, scene or (), place, Console())
        print(page.write(place))
        return Exit.FINE

    _exit(action)


@app.command()
def claims(
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="the page; a new one under results/runs if not given")
    ] = None,
    tables: Annotated[Path, typer.Option(help="the folder that has baselines/ and needs/")] = TABLES,
) -> None:
    """Hold what papers claim against what was measured.

    Exit code 1 where a table contradicts a verdict.
    """

    def action() -> int:
        from benchharness.execution import folder
        from benchharness.report import claims as page

        outcome = page.write(out or folder.stamped("claims") / page.PAGE, tables)
        for line in outcome.lines:
            print(line)
        print(outcome.page)
        return outcome.code

    _exit(action)


@app.command()
def inspect(
    asked: Annotated[Path, typer.Argument(metavar="FILE|CONFIG", help="a mesh file, or a study: a TOML file or its name")],
    out: Annotated[Path | None, typer.Option(help="folder of the pictures; a new one under results/runs if not given")] = None,
    size: Annotated[tuple[int, int], typer.Option(metavar="W H", help="pixels of the pictures")] = (480, 342),
) -> None:
    """Say what a file or a study holds, before anything is run.

    Exit code 2 if it cannot be run.
    """

    def action() -> int:
        from benchharness import inspection
        from benchharness.execution import folder

        for note in inspection.examined(asked, out or folder.stamped("inspect"), size, Console(stderr=True)):
            print(note)
        return Exit.FINE

    _exit(action)


@app.command()
def report(run: RunFolder) -> None:
    """Write report.html of a run anew."""

    def action() -> int:
        from benchharness import report

        print(report.write(run))
        return Exit.FINE

    _exit(action)


@app.command()
def compare(
    base: Annotated[Path, typer.Argument(help="what was: a run folder, its results.csv, or a folder of run folders")],
    new: Annotated[Path, typer.Argument(help="what is: the same")],
    fail_on_time: Annotated[
        bool, typer.Option("--fail-on-time", help="what is proven slower is a regression, too; see `rerun`")
    ] = False,
    format: Annotated[str, typer.Option(help="text, json, junit or markdown")] = "text",
) -> None:
    """Say whether a change made it better or worse.

    Exit code 1 for a regression, 4 if it cannot be said.
    """

    def action() -> int:
        from benchharness.tables import compare, formats

        if format not in formats.FORMATS:
            from benchharness.study import plugins

            raise ValueError(f"--format: {plugins.unknown(format, formats.FORMATS)}")
        verdict = compare.compare(base, new, fail_on_time=fail_on_time)
        print(formats.FORMATS[format](verdict))
        return verdict.exit_code

    _exit(action)


@app.command()
def rerun(
    config: Study,
    against: Annotated[
        Path | None, typer.Option(help="the base: a checkout, or another environment's python; this code if not given")
    ] = None,
    times: Annotated[int, typer.Option(help="runs of each side")] = 10,
    out: Out = None,
    only: Only = None,
    plugin: Plugin = None,
    resume: Annotated[bool, typer.Option("--resume", help="keep the runs that --out has")] = False,
) -> None:
    """Run two installations in turns, and say which is slower.

    Exit code 1 if this one is, without doubt.
    """

    def action() -> int:
        from benchharness.execution import folder, rerun
        from benchharness.tables import compare, formats

        options = [word for name in only or () for word in ("--only", name)]
        options += [word for spec in plugin or () for word in ("--plugin", spec)]
        place = out or folder.stamped(f"rerun-{config.stem}")
        try:
            sides = rerun.rerun([str(config), *options], times, against, place, print, resume=resume)
        except rerun.RunFailed as error:
            known = set(Exit) - {Exit.FINE, Exit.REGRESSION}
            return _said(error, error.code if error.code in known else Exit.INCOMPLETE)
        verdict = compare.compare(*sides, fail_on_time=True)
        print(formats.as_text(verdict))
        return verdict.exit_code

    _exit(action)


@app.command()
def accept(
    run: RunFolder,
    because: Annotated[str, typer.Option(help="the reason, which is kept")],
    baselines: Annotated[Path, typer.Option(help="folder of the baselines")] = BASELINES,
    replace: Annotated[bool, typer.Option("--replace", help="drop a baseline of other settings or scenes")] = False,
) -> None:
    """Make a run the baseline of its config."""

    def action() -> int:
        from benchharness.tables import baseline

        print(baseline.accept(run, baselines, because, replaces=replace))
        return Exit.FINE

    _exit(action)


@app.command("list")
def list_(
    what: Annotated[str | None, typer.Argument(help="methods, scenes, configs or metrics; all if not given")] = None,
) -> None:
    """Show what there is to run, and what is measured."""

    def action() -> int:
        from benchharness.study import listing, plugins

        if what is not None and what not in listing.KINDS:
            raise ValueError(f"list: {plugins.unknown(what, listing.KINDS)}")
        for kind in listing.KINDS if what is None else (what,):
            if what is None:
                print(f"{kind}:")
            for line in listing.KINDS[kind]():
                print(line)
        return Exit.FINE

    _exit(action)


@app.command("new-method")
def new_method(name: Annotated[str, typer.Argument(help="such as my_method")]) -> None:
    """Write a small method that runs, as a start."""

    def action() -> int:
        from benchharness.study import template

        path = template.new_method(name, Path())
        print(f"{path}\nbenchharness check-method {path}\nbenchharness run CONFIG --plugin {path}")
        return Exit.FINE

    _exit(action)


@app.command("check-method")
def check_method(file: Annotated[str, typer.Argument(metavar="FILE[:NAME]")]) -> None:
    """See whether a method keeps its contract.

    Exit code 2 if it does not.
    """

    def action() -> int:
        from benchharness.execution import check

        found = check.check(file)
        for finding in found:
            print(f"{finding.level}  {finding.text}")
        return Exit.WRONG_INPUT if any(finding.level == "fail" for finding in found) else Exit.FINE

    _exit(action)


@app.command()
def doctor() -> None:
    """Try every variant here, and say how to mend what fails."""

    def action() -> int:
        from benchharness.execution import doctor

        diagnoses = doctor.examine()
        for diagnosis in diagnoses:
            print(f"{diagnosis.name}: {'works' if diagnosis.works else 'does not work'}: {diagnosis.seen}")
            if diagnosis.mend is not None:
                print(f"  mend: {diagnosis.mend}")
        return Exit.FINE if doctor.usable(diagnoses) else Exit.BROKEN_ENVIRONMENT

    _exit(action)


def main() -> None:
    """The console script. What we did not foresee is a traceback and exit code 3, never 1, which means a regression; so is
    an interruption, by Ctrl-C or SIGTERM, at whatever moment."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        try:
            app()
        finally:  # all is said and written, and an interpreter that is about to end has no handler any more
            for number in (signal.SIGINT, signal.SIGTERM):
                signal.signal(number, signal.SIG_IGN)
    except (SystemExit, KeyboardInterrupt) as end:
        if _interrupted(end):  # outside any command, where Typer has a code of its own
            sys.exit(Exit.INCOMPLETE)
        raise
    except Exception:
        traceback.print_exc()
        sys.exit(Exit.INCOMPLETE)


def _interrupted(end: BaseException | None) -> bool:
    return end is not None and (isinstance(end, KeyboardInterrupt) or _interrupted(end.__context__))


def _exit(action: Callable[[], int]) -> NoReturn:
    """Ends the command with what the action returns, or with the code of what it raises and one clear message."""
    try:
        code = _code(action)
    except KeyboardInterrupt:
        code = _said("interrupted; the same with --resume takes up where it stopped", Exit.INCOMPLETE)
    raise typer.Exit(code)


def _code(action: Callable[[], int]) -> int:
    from benchharness.execution.folder import Incomparable

    try:
        return action()
    except platform.EnvironmentBroken as error:
        return _said(error, Exit.BROKEN_ENVIRONMENT)
    except Incomparable as error:
        return _said(error, Exit.INCOMPARABLE)
    except ValueError as error:
        return _said(error, Exit.WRONG_INPUT)
    except OSError as error:
        where = f"{error.filename}: " if error.filename is not None else ""
        return _said(
            f"{where}{error.strerror or error}", Exit.BROKEN_ENVIRONMENT if error.errno in EXHAUSTED else Exit.WRONG_INPUT
        )


def _said(message: object, code: int) -> int:
    Console(stderr=True, soft_wrap=True).print(f"[red]error:[/red] {escape(str(message))}", highlight=False)
    return code
