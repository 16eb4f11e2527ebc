"""How to read a number: the meaning, unit and direction of every column that the report shows."""

from __future__ import annotations

from dataclasses import dataclass

TEXT = """
frame_ms | frame | ms | less
    A whole frame: rasterized first hits, update if anything moved, shade, composite. Median over frames.
shade_ms | shade | ms | less
    The method's work in every frame: wall time, synchronised on both sides, median over rounds, then over frames;
    its interval is the median's 95 % bootstrap interval.
update_ms | update | ms | less
    The method's work when something moved: maps, impostors, what does not depend on the eye.
prepare_ms | prepare | ms | less
    The method's work once per scene. Not part of a frame.
kernel_ms | kernel | ms | less
    Execution on the device alone, without tracing and launching: what is left of shade if the host costs nothing.
first_ms | first | ms | less
    The first frame of all, cold: tracing and compiling included.
gbuffer_ms | G-buffer | ms | less
    Rasterizing the first hit of every pixel; the same for every method.
flip | FLIP |  | less
    Mean of the FLIP map against the reference inside the mirror's mask, 0 to 1: how different the two look when
    flipped between. Below 0.01 few people see it.
flip_p95 | FLIP p95 |  | less
    95th percentile of the FLIP map inside the mask: the worst visible parts, that a mean hides.
rmse | RMSE | radiance | less
    Root mean square difference of linear radiance inside the mask. Bright spots dominate it.
relmse | relMSE |  | less
    Mean of (difference² / (reference² + 0.01)): weighs dark and bright parts alike.
coverage | coverage |  | more
    Share of the mirror's pixels for which the method has an answer. The others are counted in every error as they
    are shown.
nonfinite_px | non-finite | px | less
    Pixels that are NaN, infinite or negative, over all frames. Any is a bug.
distance_err | distance error |  | less
    Median relative error of the length of the reflected ray against the traced ray.
residual_px | residual | px | less
    Screen distance between the reflection point found and the true one, for methods that search reflection points
    of vertices: median of the vertices whose search says that it converged.
residual_px_max | residual max | px | less
    The largest of those distances.
converged_ratio | converged |  | more
    Share of vertices whose search says that it converged.
wrong_ratio | wrong |  | less
    Share of vertices whose search says that it converged, more than 2 px from the truth.
iterations_mean | iterations |  | less
    Steps of the search per vertex.
iterations_max | iterations max |  | less
    Most steps that any vertex took in any frame.
temporal_diff | temporal | radiance | less
    Mean |change of the picture - change of the reference| from frame to frame: flicker and swimming. A constant
    error gives 0.
jitter_px | jitter | px | less
    Root mean square second difference of the screen error of virtual vertices along the path.
flip_second | FLIP second |  | less
    Mean of the FLIP map over the pixels that show a second reflection: those whose reflected ray meets a mirror first.
    Empty where there are none, and against a reference of one bounce, which shows such mirrors black.
second_px | second | px | less
    Those pixels, over all frames: a fact about the scene, the same for every method.
reference_px | mirrors' pixels | px | more
    Pixels whose first hit is a mirror in the reference; in the frame, as the methods see it, it is `reflector_px`.
mask_diff_px | mask differs | px | less
    Pixels that are a mirror's in only one of the two. More than a few along the edges mean that the two do not show the
    same thing; then nothing is ranked.
dark_px | dark | px | less
    Pixels of the mirrors in which the reference is black: no error can be seen there.
back_px | backs | px | less
    Pixels of the mirrors that show the back of an object, which has the light of its front.
frames_ok | frames ok |  | more
    Frames with status ok, of those that were asked for. Times are medians and errors are means over these alone.
"""


@dataclass(frozen=True)
class Column:
    """`better` is "less" or "more"; `unit` is "" for what has none."""

    name: str
    title: str
    unit: str
    better: str
    meaning: str


def _columns(text: str) -> dict[str, Column]:
    """Lines `name | title | unit | better`, each followed by its meaning, indented."""
    found: list[list[str]] = []
    for line in text.strip().splitlines():
        if line.startswith(" "):
            found[-1][4] = f"{found[-1][4]} {line.strip()}".strip()
        else:
            found.append([*(part.strip() for part in line.split("|")), ""])
    return {cells[0]: Column(*cells) for cells in found}


COLUMNS = _columns(TEXT)

STATUSES = {
    "ok": "a picture and numbers",
    "refused": "the method says that it cannot serve this scene",
    "invalid": "the picture has pixels that are not finite, or there is nothing that it could be judged by",
    "timeout": "it did not end in time",
    "crashed": "it raised an error or ended its process",
}


def markdown() -> str:
    """docs/columns.md, for `python -m benchharness.report.columns`."""
    rows = [
        f"| `{c.name}` | {c.title} | {c.unit} | {c.better} | {c.meaning.replace('|', '&#124;')} |" for c in COLUMNS.values()
    ]
    statuses = [f"| `{name}` | {meaning} |" for name, meaning in STATUSES.items()]
    head = "# Columns\n\nOf `results.csv` and `summary.csv`, as the report shows them. "
    head += "An empty cell has no meaning for that method; it is not 0."
    table = "| column | in the report | unit | better | what it says |\n|---|---|---|---|---|"
    return "\n".join([head, "", table, *rows, "", "| status | |", "|---|---|", *statuses, ""])


if __name__ == "__main__":
    print(markdown(), end="")
