"""The columns of a run's tables: what each is called, holds and says. All that knows a column knows it from here.

A metric is a column of RESULTS and the function that computes it. The files' order and kinds, the rows of a summary, the report
and its explanations, what `compare` judges and by which tolerance, `benchharness list metrics` and docs/columns.md follow.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

Kind = Literal["text", "integer", "number"]


@dataclass(frozen=True)
class Gate:
    """How much worse is the same: `absolute + relative * |base|`, on another machine. `because` says why not less.

    local  it hangs on so few pixels or vertices that another machine's rounding moves it farther than any tolerance that would
           still find a fault: judged within one environment alone, a note elsewhere
    """

    absolute: float
    relative: float
    because: str
    local: bool = False

    def __str__(self) -> str:
        """As "0.0005 + 1 %"."""
        parts = [f"{self.absolute:g}"] * bool(self.absolute) + [f"{100 * self.relative:g} %"] * bool(self.relative)
        return (" + ".join(parts) or "0") + " (in one environment)" * self.local


@dataclass(frozen=True)
class Column:
    """A column of a table.

    says    what a number of it means
    title   what it is called in the report's tables; "" for one that is not shown there
    better  which way a method is better; "" for what is no merit of a method
    over    how the frames of a method become one row: "median" and "mean" of the frames that are ok, "max" likewise, "sum" of
            all; "" for a column that a summary does not have
    gate    by which `compare` judges it; None for what it does not judge
    image   whether it is an error of the picture: not ranked where it is within the reference's noise
    """

    name: str
    kind: Kind
    says: str
    unit: str = ""
    title: str = ""
    better: Literal["", "less", "more"] = ""
    over: Literal["", "median", "mean", "max", "sum"] = ""
    gate: Gate | None = None
    image: bool = False

    @property
    def sign(self) -> int:
        """+1 where more is worse, -1 where less is."""
        return -1 if self.better == "more" else 1


def _text(name: str, says: str) -> Column:
    return Column(name, "text", says)


def _clock(name: str, title: str, says: str) -> Column:
    return Column(name, "number", says, unit="ms", title=title, better="less", over="median")


def _error(name: str, title: str, says: str, gate: Gate | None = None, unit: str = "", *, image: bool = False) -> Column:
    return Column(name, "number", says, unit, title, "less", "mean", gate, image)


def _share(name: str, title: str, says: str, gate: Gate) -> Column:
    return Column(name, "number", says, title=title, better="more", over="mean", gate=gate)


def _pixels(name: str, title: str, says: str, better: Literal["", "less"] = "", gate: Gate | None = None) -> Column:
    return Column(name, "integer", says, "px", title, better, "sum", gate)


SUBPIXEL = Gate(0.01, 0.02, "A hundredth of a pixel is the tolerance of the searches themselves.", local=True)

RESULTS = (
    _text("run", "The run's folder."),
    _text("config", "The study."),
    _text("scene", "The scene, with its parameters."),
    _text("detail", 'How finely it is modelled: "lean" or "paper".'),
    Column("frame", "integer", "Index of the frame."),
    _text("method", "The method."),
    _text("params", "Its parameters, as `name=value; name=value`."),
    _text("variant", "Mitsuba's variant: what device it ran on."),
    _text("status", "What became of the frame, see below."),
    _text("reason", "Why it is not ok."),
    Column("vertices", "integer", "Vertices of the scene as it was drawn."),
    Column("triangles", "integer", "Its triangles."),
    Column("reflectors", "integer", "Its mirrors."),
    Column("reflector_px", "integer", "Pixels whose first hit is a mirror: those in which a method is asked.", unit="px"),
    _clock("prepare_ms", "prepare", "The method's work once per scene. Not part of a frame."),
    _clock("update_ms", "update", "The method's work when something moved: maps, impostors, what does not depend on the eye."),
    _clock(
        "shade_ms",
        "shade",
        "The method's work in every frame: wall time, synchronised on both sides, median over rounds, then over frames; "
        "its interval is the median's 95 % bootstrap interval.",
    ),
    Column("shade_ms_lo", "number", "Lower end of that interval.", unit="ms", over="median"),
    Column("shade_ms_hi", "number", "Upper end of that interval.", unit="ms", over="median"),
    _clock(
        "kernel_ms",
        "kernel",
        "Execution on the device alone, without tracing and launching: what is left of shade if the host costs nothing.",
    ),
    _clock("first_ms", "first", "The first frame of all, cold: tracing and compiling included."),
    Column(
        "gbuffer_ms",
        "number",
        "Rasterizing the first hit of every pixel; the same for every method.",
        unit="ms",
        title="G-buffer",
        over="median",
    ),
    _clock(
        "frame_ms",
        "frame",
        "A whole frame: rasterized first hits, update if anything moved, shade, composite. Median over frames.",
    ),
    _error(
        "rmse",
        "RMSE",
        "Root mean square difference of linear radiance inside the mask. Bright spots dominate it.",
        Gate(1e-4, 0.01, "Radiance is of order 1; a highlight that moves by a pixel is a seventh of it.", local=True),
        unit="radiance",
        image=True,
    ),
    _error(
        "relmse",
        "relMSE",
        "Mean of (difference² / (reference² + 0.01)): weighs dark and bright parts alike.",
        Gate(1e-4, 0.02, "Squared, hence twice the share; a highlight that moves by a pixel is half of it.", local=True),
        image=True,
    ),
    _error(
        "flip",
        "FLIP",
        "Mean of the FLIP map against the reference inside the mirror's mask, 0 to 1: how different the two look when "
        "flipped between. Below 0.01 few people see it.",
        Gate(5e-4, 0.01, "Another CPU moves single edge pixels, which a mean hardly feels; FLIP below 0.0005 is not seen."),
        image=True,
    ),
    _error(
        "flip_p95",
        "FLIP p95",
        "95th percentile of the FLIP map inside the mask: the worst visible parts, that a mean hides.",
        Gate(2e-3, 0.02, "A percentile jumps from pixel to pixel of the map."),
        image=True,
    ),
    _share(
        "coverage",
        "coverage",
        "Share of the mirror's pixels for which the method has an answer. The others are counted in every error as they are "
        "shown.",
        Gate(1e-3, 0.0, "A thousandth of the pixels is the rounding along the silhouette."),
    ),
    _pixels(
        "nonfinite_px",
        "non-finite",
        "Pixels that are NaN, infinite or negative, over all frames. Any is a bug.",
        "less",
        Gate(0.0, 0.0, "No non-finite pixel is a rounding error."),
    ),
    _error(
        "distance_err",
        "distance error",
        "Median relative error of the length of the reflected ray against the traced ray.",
        Gate(1e-5, 0.02, "1e-5 of a length is the rounding of float32 lengths against a ray traced in float32."),
    ),
    _error(
        "residual_px",
        "residual",
        "Screen distance between the reflection point found and the true one, for methods that search reflection points of "
        "vertices: median of the vertices whose search says that it converged.",
        SUBPIXEL,
        unit="px",
    ),
    _share(
        "converged_ratio",
        "converged",
        "Share of vertices whose search says that it converged.",
        Gate(2e-3, 0.0, "Twice that of pixels, as there are a few thousand vertices."),
    ),
    _error(
        "wrong_ratio",
        "wrong",
        "Share of vertices whose search says that it converged, more than 2 px from the truth.",
        Gate(1e-3, 0.0, "A vertex in a thousand is rounding along the silhouette."),
    ),
    _error(
        "iterations_mean",
        "iterations",
        "Steps of the search per vertex.",
        Gate(0.0, 0.01, "Work is counted; a hundredth is for searches that stop one step apart on another CPU."),
    ),
    Column(
        "iterations_max",
        "integer",
        "Most steps that any vertex took in any frame.",
        title="iterations max",
        better="less",
        over="max",
        gate=Gate(1.0, 0.01, "One search may stop one step later.", local=True),
    ),
    _error(
        "temporal_diff",
        "temporal",
        "Mean |change of the picture - change of the reference| from frame to frame: flicker and swimming. A constant error "
        "gives 0.",
        Gate(1e-4, 0.02, "Radiance is of order 1, and a difference of differences has twice the rounding.", local=True),
        unit="radiance",
        image=True,
    ),
    _error(
        "jitter_px",
        "jitter",
        "Root mean square second difference of the screen error of virtual vertices along the path.",
        SUBPIXEL,
        unit="px",
    ),
    _text("reference_lighting", 'Light of the reference: "baked" or "transport".'),
    Column("reference_spp", "integer", "Its samples per pixel."),
    Column(
        "reference_noise",
        "number",
        "Mean FLIP inside the mask that the reference's own noise causes: errors below it are not ranked.",
        over="mean",
    ),
    _text("config_hash", "Of the study's settings."),
    _text("method_hash", "Of the method's code."),
    _text("scene_hash", "Of what its pictures are made from: meshes, light, motion, cameras. The same on all processors."),
    _text("environment", "Hash of the machine and its software, see `environment.json`."),
    Column(
        "calibration_ms", "number", "Time of a fixed kernel, which relates times of two machines.", unit="ms", over="median"
    ),
    Column("ppd", "number", "Pixels per degree at which FLIP looks."),
    _text("counters", "Work that was counted, as `name=value; name=value`; `compare` judges each, to a hundredth."),
    _error("residual_px_max", "residual max", "The largest of those of `residual_px`.", unit="px"),
    _pixels(
        "second_px",
        "second",
        "Pixels that show a second reflection: those whose reflected ray meets a mirror first. A fact about the scene; over "
        "all frames.",
    ),
    _error(
        "flip_second",
        "FLIP second",
        "Mean of the FLIP map over those pixels. Empty where there are none, and against a reference of one bounce, which "
        "shows such mirrors black.",
    ),
    Column(
        "reference_px",
        "integer",
        "Pixels whose first hit is a mirror in the reference; in the frame, as the methods see it, it is `reflector_px`.",
        unit="px",
        title="mirrors' pixels",
    ),
    _pixels(
        "mask_diff_px",
        "mask differs",
        "Pixels that are a mirror's in only one of the two. More than a few along the edges mean that the two do not show the "
        "same thing; then nothing is ranked.",
        "less",
    ),
    _pixels("dark_px", "dark", "Pixels of the mirrors in which the reference is black: no error can be seen there."),
    _pixels("back_px", "backs", "Pixels of the mirrors that show the back of an object, which has the light of its front."),
    _text("family", "Of what kind the method is, as it says; charts group methods by it."),
)
"""The columns of results.csv, in order: a row per scene, frame, method and parameters."""

GROUP = ("config", "scene", "detail", "method", "params")
"""What a row of summary.csv is about: all frames of it."""
_OWN = (
    Column("frames", "integer", "Frames that were asked for."),
    Column(
        "frames_ok",
        "integer",
        "Frames with status ok, of those that were asked for. Times are medians and errors are means over these alone.",
        title="frames ok",
        better="more",
    ),
    Column("frames_in_view", "integer", "Frames in which a mirror is in view."),
    Column("ok_ratio", "number", "Share of the frames that are ok."),
    Column("flip_min", "number", "FLIP of the frame in which it is least."),
    Column("flip_max", "number", "FLIP of the frame in which it is most."),
)
SUMMARY = (
    *(column for column in RESULTS if column.name in (*GROUP, "status", "reason")),
    *_OWN,
    *(column for column in RESULTS if column.over),
)
"""The columns of summary.csv, in order: a row per method and parameters in a scene, with the status of its worst frame."""

KEY = ("scene", "detail", "frame", "method", "params")
"""What a row of results.csv is about."""
SAMPLES = (
    *(column for column in RESULTS if column.name in KEY),
    _text("clock", "prepare, update, shade, kernel, gbuffer, calibration ..."),
    Column("round", "integer", "From 0."),
    Column("ms", "number", "The time.", unit="ms"),
)
"""The columns of samples.csv, in order: a row for every time that was taken."""

CLAIMS = (
    _text("id", "What the claim is called."),
    _text("source", "The paper, by its authors and year."),
    _text("section", "Where in it the claim stands."),
    _text("kind", "What it is: a table, a figure, a sentence or an equation."),
    _text("says", "What is claimed, in our words, with the numbers as they are given."),
    _text("measures", "The method, scene and metric that answer it."),
    _text("verdict", "What has become of it, see below."),
    _text("found", "What was measured here. Of a query: by case, read from the table when the file was written."),
    _text("expected", "What a query's numbers have to be for the claim to hold; empty where there is none."),
    _text("agrees", "Whether the verdict is what the table says: yes or no; empty without a query."),
    _text("shown", "Where the number stands: a table, pages, tests."),
    _text("command", "What makes it anew."),
    _text("because", "What has to be known to read it; why it cannot be tested."),
)
"""The columns of claims.csv, in order: a row per claim of a paper, see `benchharness.tables.claims`."""

STATUSES = {
    "ok": "a picture and numbers",
    "refused": "the method says that it cannot serve this scene",
    "invalid": "the picture has pixels that are not finite, or there is nothing that it could be judged by",
    "timeout": "it did not end in time",
    "crashed": "it raised an error or ended its process",
}
"""What became of a frame, from best to worst."""
BROKEN = ("crashed", "timeout")
"""Those in which nobody gave an answer."""
VERDICTS = ("holds", "degrades", "fails", "refuses")
"""What the stability suite says of a row, see `benchharness.stability.atlas.verdict`."""


def metrics() -> tuple[Column, ...]:
    """The columns of RESULTS that the report shows, in order."""
    return tuple(column for column in RESULTS if column.title)


def kinds(columns: Iterable[Column]) -> dict[str, Kind]:
    """Name -> kind, in order."""
    return {column.name: column.kind for column in columns}
