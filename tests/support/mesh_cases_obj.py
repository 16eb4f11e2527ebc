"""OBJ files, small ones, as users have them."""

from __future__ import annotations

import numpy as np
from support.mesh_cases import (
    BALL,
    BALL_AREA,
    BALL_FACES,
    BALL_VOLUME,
    BLUE,
    CUBE,
    GREEN,
    GREY,
    LIGHT,
    MADE,
    QUADS,
    RED,
    SQUARE,
    TRIANGLES,
    WITHIN_CUBE,
    Case,
    text,
)

GROUPS = "normals are made from the smoothing groups"


def rows(word: str, values) -> str:
    return "".join(f"{word} {' '.join(format(x, '.17g') for x in row)}\n" for row in values)


def faces(values, form: str = "{0}") -> str:
    """Faces of numbers from 0; `form` gets the number from 1."""
    return "".join(f"f {' '.join(form.format(i + 1) for i in face)}\n" for face in values)


cube, ball = rows("v", CUBE), rows("v", BALL)
square = rows("v", SQUARE) + rows("vt", SQUARE[:, :2]) + "usemtl m\nf 1/1 2/2 3/3 4/4\n"
one = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
whole_cube = {"box": WITHIN_CUBE, "area": 24, "volume": 8, "closed": True}
whole_ball = {"area": BALL_AREA, "volume": BALL_VOLUME, "faces": len(BALL_FACES), "closed": True, "normals": "radial"}
CORNERS = {(0.25, 0.25, 0): BLUE, (0.75, 0.25, 0): LIGHT, (0.25, 0.75, 0): RED, (0.75, 0.75, 0): GREEN}


def seamed() -> str:
    """A ball of which every corner has coordinates of its own."""
    uv = BALL[BALL_FACES].reshape(-1, 3)[:, :2]
    corners = np.arange(len(uv)).reshape(-1, 3)
    each = zip(BALL_FACES, corners, strict=True)
    return ball + rows("vt", uv) + "".join(f"f {' '.join(f'{v + 1}/{t + 1}' for v, t in zip(*f, strict=True))}\n" for f in each)


def mapped(options: str, **more) -> dict:
    """A textured square: its library names the picture with options."""
    name = more.pop("file", "picture.png")
    return {"write": text("a.obj", "mtllib m.mtl\n" + square, m_mtl=f"newmtl m\nKd 1 1 1\nmap_Kd {options} {name}\n"), **more}


star = [(np.cos(a) * r, np.sin(a) * r, 0) for a, r in zip(np.arange(10) * np.pi / 5, [2, 1] * 5, strict=True)]
ring = [(0, 0, 0), (4, 0, 0), (4, 4, 0), (0, 4, 0), (0, 0, 0), (1, 1, 0), (1, 3, 0), (3, 3, 0), (3, 1, 0), (1, 1, 0)]
wedge = "v 0 0 0\nv 1 0 -1\nv 0 1 0\nv -1 0 -1\n"

NORMALS = [
    Case(
        "normals of nothing",
        text("a.obj", ball + "vn 0 0 0\n" + faces(BALL_FACES, "{0}//1")),
        **whole_ball,
        says=(f"no direction.*: {len(BALL)}",),
    ),
    Case(
        "a normal that is no number",
        text("a.obj", ball + rows("vn", BALL[:-1]) + "vn nan nan nan\n" + faces(BALL_FACES, "{0}//{0}")),
        **whole_ball,
        says=("no direction.*: 1$",),
    ),
    Case(
        "a normal of another runtime",
        text("a.obj", ball + rows("vn", BALL[:-1]) + "vn -1.#IND 0 1.#QNAN\n" + faces(BALL_FACES, "{0}//{0}")),
        **whole_ball,
        says=("no direction.*: 1$",),
    ),
    Case("normals of any length", text("a.obj", ball + rows("vn", 7 * BALL) + faces(BALL_FACES, "{0}//{0}")), **whole_ball),
    Case(
        "normals turned inwards",
        text("a.obj", ball + rows("vn", -BALL) + faces(BALL_FACES, "{0}//{0}")),
        **whole_ball,
        says=(f"points away.*: {len(BALL)}",),
    ),
    Case(
        "one normal turned inwards",
        text("a.obj", ball + rows("vn", np.r_[BALL[:-1], -BALL[-1:]]) + faces(BALL_FACES, "{0}//{0}")),
        **whole_ball,
        says=("points away.*: 1$",),
    ),
    Case(
        "some normals are missing",
        text("a.obj", ball + rows("vn", BALL) + faces(BALL_FACES[:100], "{0}//{0}") + faces(BALL_FACES[100:])),
        says=("without a normal in a file that has some",),
        area=BALL_AREA,
        volume=BALL_VOLUME,
        closed=True,
    ),
    Case(
        "a normal that is not there",
        text("a.obj", one + "vn 0 0 1\nf 1//1 2//1 3//5\n"),
        normals=(0, 0, 1),
        says=("normals which are not there: 1", "without a normal"),
    ),
    Case("a tilted normal is the file's", text("a.obj", one + "vn 0 0.28 0.96\nf 1//1 2//1 3//1\n"), normals=(0, 0.28, 0.96)),
    Case(
        "a cube of eight corners", text("a.obj", cube + faces(TRIANGLES)), **whole_cube, faces=12, normals="flat", says=(MADE,)
    ),
    Case(
        "a pane of eight corners",
        text("a.obj", rows("v", CUBE * [0.8, 0.005, 0.8]) + faces(TRIANGLES)),
        area=5.184,
        volume=0.0256,
        faces=12,
        closed=True,
        normals="flat",
        says=(MADE,),
    ),
    Case(
        "a cube of six normals",
        text(
            "a.obj",
            cube
            + rows("vn", [(0, 0, -1), (0, 0, 1), (0, -1, 0), (1, 0, 0), (0, 1, 0), (-1, 0, 0)])
            + "".join(faces([q], "{0}//" + str(k + 1)) for k, q in enumerate(QUADS)),
        ),
        **whole_cube,
        normals="flat",
    ),
    Case(
        "a cube smooth by its group",
        text("a.obj", cube + "s 1\n" + faces(QUADS)),
        **whole_cube,
        normals="radial",
        says=(GROUPS, "30 degrees off their face.*: 36"),
    ),
    Case(
        "a ball with facets by its group",
        text("a.obj", ball + "s off\n" + faces(BALL_FACES)),
        area=BALL_AREA,
        closed=True,
        normals="flat",
        says=(GROUPS,),
    ),
    Case(
        "a roof of two groups",
        text("a.obj", wedge + "s 1\nf 1 2 3\ns 2\nf 1 3 4\n"),
        normals="flat",
        area=2**0.5,
        says=(GROUPS,),
    ),
    Case("a seam of coordinates", text("a.obj", seamed()), **whole_ball, says=(MADE,)),
    Case(
        "a seam of a material",
        text("a.obj", ball + "usemtl a\n" + faces(BALL_FACES[:160]) + "usemtl b\n" + faces(BALL_FACES[160:])),
        area=BALL_AREA,
        normals="radial",
        parts={"a": GREY, "b": GREY},
        says=(MADE, "no library has.*: a, b"),
    ),
    Case(
        "a side wound the other way",
        text("a.obj", cube + faces(QUADS[:5]) + faces([QUADS[5][::-1]])),
        **whole_cube,
        normals="flat",
        says=(MADE, "against their neighbours, turned: 2"),
    ),
    Case(
        "a room wound inwards",
        text("a.obj", cube + faces([q[::-1] for q in QUADS])),
        area=24,
        volume=-8,
        normals="flat",
        says=(MADE,),
    ),
]

FACES = [
    Case(
        "an index twice",
        text("a.obj", cube + faces(QUADS) + "f 1 1 2\nf 3 4 3\n"),
        **whole_cube,
        faces=12,
        says=(MADE, "two corners.*: 2"),
    ),
    Case(
        "two corners at one place",
        text("a.obj", cube + "v -1 -1 -1\nv 1 -1 -1\n" + faces(QUADS) + "f 1 9 3\n"),
        **whole_cube,
        faces=12,
        says=(MADE, "two corners at one place.*: 1"),
    ),
    Case(
        "three corners in one line",
        text("a.obj", cube + "v 0 -1 -1\n" + faces(QUADS) + "f 1 9 2\n"),
        **whole_cube,
        faces=12,
        says=(MADE, "one line, left out: 1"),
    ),
    Case(
        "a needle that closes a gap",
        text("a.obj", cube + "v 0 -1 -1\n" + faces(QUADS[:2]) + "f 1 9 6\nf 9 2 6\nf 1 6 5\nf 1 2 9\n" + faces(QUADS[3:])),
        **whole_cube,
        faces=14,
        says=(MADE,),
    ),
    Case(
        "numbers from where they stand",
        text("a.obj", one + "f -3 -2 -1\nv 0 0 5\nv 2 0 5\nv 0 2 5\nf -3 -2 -1\n"),
        faces=2,
        area=2.5,
        box=((0, 0, 0), (2, 2, 5)),
        says=(MADE,),
    ),
    Case(
        "all numbers from where they stand",
        text("a.obj", (one + "vt 0 0\nvn 0 0.28 0.96\nf -3/-1/-1 -2/-1/-1 -1/-1/-1\n") * 2),
        area=1,
        normals=(0, 0.28, 0.96),
    ),
    Case("tabs", text("a.obj", "v\t0\t0\t0\nv\t1\t0\t0\nv\t0\t1\t0\nf\t1\t2\t3\n"), area=0.5, says=(MADE,)),
    Case("Latin-1", text("a.obj", "# Größe\n" + one + "f 1 2 3\n", "latin-1"), area=0.5, says=(MADE,)),
    Case("UTF-16", text("a.obj", "# Größe\n" + one + "f 1 2 3\n", "utf-16"), area=0.5, says=(MADE,)),
    Case("UTF-8 with a mark", text("a.obj", one + "f 1 2 3\n", "utf-8-sig"), area=0.5, says=(MADE,)),
    Case("lines that end in CR LF", text("a.obj", (one + "f 1 2 3\n").replace("\n", "\r\n")), area=0.5, says=(MADE,)),
    Case("lines that end in CR", text("a.obj", (one + "f 1 2 3\n").replace("\n", "\r")), area=0.5, says=(MADE,)),
    Case("lines that go on", text("a.obj", "v 0 0 \\\n0\n" + one[8:] + "f 1 \\\n 2 \\\r\n 3\n"), area=0.5, says=(MADE,)),
    Case(
        "blanks and comments",
        text("a.obj", "\n\n  v 0 0 0 # here\n" + one[8:] + "   \nf 1 2 3 # there\n#f 3 2 1\n"),
        faces=1,
        area=0.5,
        says=(MADE,),
    ),
    Case(
        "corners in several forms",
        text("a.obj", cube + "vt 0 0\n" + "f 1/1 4/1/ 3 2//\n" + faces(QUADS[1:])),
        **whole_cube,
        says=(MADE,),
    ),
    Case(
        "a concave pentagon",
        text("a.obj", "v 1 0.5 0\nv 0 2 0\nv 0 0 0\nv 2 0 0\nv 2 2 0\nf 2 3 4 5 1\n"),
        faces=3,
        area=2.5,
        normals=(0, 0, 1),
        says=(MADE,),
    ),
    Case(
        "a star",
        text("a.obj", rows("v", star) + "f 1 2 3 4 5 6 7 8 9 10\n"),
        faces=8,
        area=10 * np.sin(np.pi / 5),
        normals=(0, 0, 1),
        says=(MADE,),
    ),
    Case(
        "a ring, cut open",
        text("a.obj", rows("v", ring) + "f 1 2 3 4 5 6 7 8 9 10\n"),
        faces=8,
        area=12,
        normals=(0, 0, 1),
        says=(MADE,),
    ),
    Case(
        "a polygon that crosses itself",
        text("a.obj", "v 0 0 0\nv 2 0 0\nv 0 1 0\nv 1 1.5 0\nf 1 2 3 4\n"),
        says=(MADE, "cross themselves.*: 1"),
    ),
    Case(
        "a square in pieces of one line",
        text("a.obj", rows("v", [(0, 0, 0), (1, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0)]) + "f 1 2 3 4 5\n"),
        faces=3,
        area=4,
        normals=(0, 0, 1),
        says=(MADE,),
    ),
    Case(
        "corners that are too few",
        text("a.obj", one + "f 1 2 3\nf 1 2\n"),
        faces=1,
        says=(MADE, "fewer than three corners.*: 1"),
    ),
    Case("lines beside faces", text("a.obj", one + "l 1 2\nf 1 2 3\n"), faces=1, says=(MADE, "lines and points, left out: 1")),
    Case("points alone", text("a.obj", one), refused="no faces, and 3 points"),
    Case("nothing", text("a.obj", ""), refused="no faces"),
    Case("curves alone", text("a.obj", one + "cstype bezier\ncurv 0 1 1 2 3\n"), refused="no faces"),
    Case("faces without area", text("a.obj", one + "f 1 1 2\n"), refused="no face of it has an area"),
    Case("a place that is no number", text("a.obj", "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"), refused="vertex 0, .*finite"),
    Case(
        "a place at infinity, unused",
        text("a.obj", one + "v inf 0 0\nf 1 2 3\n"),
        area=0.5,
        box=((0, 0, 0), (1, 1, 0)),
        says=(MADE,),
    ),
    Case("vertex 0", text("a.obj", one + "f 0 1 2\n"), refused="line 4: a face names vertex 0"),
    Case("a vertex that is not there", text("a.obj", one + "\nf 1 2 3\nf 1 2 9\n"), refused="line 6: a face names vertex 9"),
    Case("a vertex before the first", text("a.obj", one + "f -4 -2 -1\n"), refused="names vertex -4"),
    Case("a corner that is none", text("a.obj", one + "f 1 2 x\n"), refused="line 4 has a corner that is none"),
    Case(
        "decimal commas", text("a.obj", "v 0,5 0 0\n" + one[8:] + "f 1 2 3\n"), refused="line 1 is 'v 0,5 0 0'.*decimal point"
    ),
    Case("two numbers", text("a.obj", "v 0 0\n" + one[8:] + "f 1 2 3\n"), refused="line 1: v has 2 numbers"),
    Case("no text", text("a.obj", "v 0 0 0\0"), refused="is no text"),
]

CASES = [*NORMALS, *FACES]
