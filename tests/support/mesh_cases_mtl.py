"""OBJ files with colours, pictures and their libraries."""

from __future__ import annotations

from support.mesh_cases import BLUE, GREEN, GREY, LIGHT, MADE, MIDDLE, QUADS, RED, Case, text
from support.mesh_cases_obj import CORNERS, cube, faces, mapped, one, square

two = cube + "usemtl red one\n" + faces(QUADS[:3]) + "usemtl blue\n" + faces(QUADS[3:])
first, second = "newmtl red one\nKd 0.5 0 0\nKs 1 1 1\nNs 10\n\n", "\tnewmtl blue\n\tKd 0 0 0.25\n\td 1.0\n"
library = first + second
coloured = "".join(f"v {x} {y} 0 {c}\n" for x, y, c in ((0, 0, "0.7372549 0 0"), (1, 0, "0 1 0"), (0, 1, "0 0 1")))

BLENT = "shown as cut-outs.*: 1"


def holed(said: str, **more) -> dict:
    """A square of a material, red where it has no picture."""
    return {"write": text("a.obj", "mtllib m.mtl\n" + square, m_mtl=f"newmtl m\nKd 1 0 0\n{said}\n"), **more}


LEFT_HALF = ((0, 0, 0), (0.5, 1, 0))
ALPHA = [
    Case("holes", **holed("d 1\nmap_d left.png", parts={"m": RED}, area=0.5, box=LEFT_HALF, says=(MADE, BLENT))),
    Case("holes by an alpha", **holed("map_d there.png", area=0.5, box=LEFT_HALF, says=(MADE, BLENT))),
    Case(
        "holes of a picture with alpha",
        **holed(
            "map_Kd there.png",
            area=0.5,
            box=LEFT_HALF,
            colours={(0.25, 0.25, 0): (0, 0, 0), (0.25, 0.75, 0): RED},
            says=(MADE, BLENT),
        ),
    ),
    Case(
        "holes elsewhere than the picture",
        **holed(
            "map_Kd -s 2 1 -o 0.5 0 there.png\nmap_d -clamp on -o 0.25 0 left.png",
            area=0.25,
            box=((0, 0, 0), (0.25, 1, 0)),
            says=(MADE, BLENT),
        ),
    ),
    Case("holes in a scaled picture", **holed("map_Kd -s 4 1 there.png", area=0.5, says=(MADE, BLENT))),
    Case(
        "holes that are nowhere",
        **holed("map_d gone.png", area=1, says=(MADE, "gone.png of material m is missing; drawn opaque")),
    ),
    Case("holes that are everywhere", **holed("map_d faint.png", area=1, says=(MADE, "let light through, drawn opaque: 1"))),
]

CASES = [
    *ALPHA,
    Case(
        "two materials",
        text("a.obj", "mtllib a.mtl\n" + two, a_mtl=library),
        area=24,
        volume=8,
        closed=True,
        parts={"red one": (0.5, 0, 0), "blue": (0, 0, 0.25)},
        colours={(0, 0, 1): (0.5, 0, 0), (-1, 0.1, 0): (0, 0, 0.25)},
        says=(MADE,),
    ),
    Case(
        "a library with blanks in its name",
        text("a.obj", "mtllib my look.mtl\n" + two, **{"my look_mtl": library}),
        parts={"red one": (0.5, 0, 0), "blue": (0, 0, 0.25)},
        says=(MADE,),
    ),
    Case(
        "two libraries in one line",
        text("a.obj", "mtllib a.mtl b.mtl\n" + two, a_mtl=first, b_mtl=second),
        parts={"red one": (0.5, 0, 0), "blue": (0, 0, 0.25)},
        says=(MADE,),
    ),
    Case(
        "a library that is not there",
        text("a.obj", "mtllib gone.mtl\n" + two),
        parts={"red one": GREY, "blue": GREY},
        says=(MADE, "library gone.mtl is missing"),
    ),
    Case(
        "a library in another case",
        text("a.obj", "mtllib A.MTL\n" + two, a_mtl=library),
        parts={"red one": (0.5, 0, 0), "blue": (0, 0, 0.25)},
        says=(MADE,),
    ),
    Case(
        "a material that is not there",
        text("a.obj", "mtllib a.mtl\n" + two, a_mtl="newmtl blue\nKd 0 0 0.25\n"),
        parts={"red one": GREY, "blue": (0, 0, 0.25)},
        says=(MADE, "no library has.*: red one"),
    ),
    Case(
        "one number for a colour",
        text("a.obj", "mtllib a.mtl\n" + two, a_mtl="newmtl blue\nKd 0.25\nnewmtl red one\nKd spectral a.rfl\n"),
        parts={"red one": GREY, "blue": (0.25,) * 3},
        says=(MADE, "spectral a.rfl', and ignored"),
    ),
    Case(
        "a colour that is no number",
        text("a.obj", "mtllib a.mtl\n" + two, a_mtl="newmtl blue\nKd nan 0 0\n"),
        refused="Kd of material blue",
    ),
    Case(
        "what shines",
        text("a.obj", "mtllib a.mtl\n" + square, a_mtl="newmtl m\nKd 0 0 0\nKe 5 6 7\n"),
        emits={"m": (5, 6, 7)},
        says=(MADE,),
    ),
    Case(
        "what is transparent and bumpy",
        text("a.obj", "mtllib a.mtl\n" + square, a_mtl="newmtl m\nKd 1 0 0\nd 0.5\nmap_Bump b.png\n"),
        parts={"m": RED},
        says=(MADE, "transparency of materials, ignored: 1", "bump and normal maps.*: 1"),
    ),
    Case("a picture", **mapped("", colours=CORNERS, says=(MADE,))),
    Case(
        "a picture beside a colour",
        text("a.obj", "mtllib m.mtl\n" + square, m_mtl="newmtl m\nKd 0.5 1 1\nmap_Kd picture.png\n"),
        colours={(0.25, 0.75, 0): (0.5, 0, 0), (0.75, 0.25, 0): (MIDDLE / 2, MIDDLE, MIDDLE)},
        says=(MADE,),
    ),
    Case(
        "a picture beside black",
        text("a.obj", "mtllib m.mtl\n" + square, m_mtl="newmtl m\nKa 0 0 0\nKd 0 0 0\nmap_Kd picture.png\n"),
        colours=CORNERS,
        says=(MADE, "0 beside a picture"),
    ),
    Case(
        "a picture twice along u",
        **mapped("-s 2 1 1", colours={(0.1, 0.25, 0): BLUE, (0.4, 0.25, 0): LIGHT, (0.6, 0.25, 0): BLUE}, says=(MADE,)),
    ),
    Case(
        "a picture moved",
        **mapped("-blendu on -o 0.5 0", colours={(0.25, 0.25, 0): LIGHT, (0.75, 0.25, 0): BLUE}, says=(MADE,)),
    ),
    Case(
        "a picture that ends",
        **mapped("-s 3 3 -clamp on", colours={(0.1, 0.1, 0): BLUE, (0.6, 0.1, 0): LIGHT, (0.9, 0.9, 0): GREEN}, says=(MADE,)),
    ),
    Case("a picture of another machine", **mapped("", file="C:\\art\\Picture.PNG", colours=CORNERS, says=(MADE,))),
    Case(
        "a picture that is not there",
        text("a.obj", "mtllib m.mtl\n" + square, m_mtl="newmtl m\nKd 1 0 0\nmap_Kd -s 2 2 2 gone.png\n"),
        parts={"m": RED},
        says=(MADE, "picture gone.png of material m is missing"),
    ),
    Case(
        "a picture that is none",
        text("a.obj", "mtllib m.mtl\n" + square, m_mtl="newmtl m\nKd 1 0 0\nmap_Kd m.mtl\n"),
        parts={"m": RED},
        says=(MADE, "picture m.mtl of material m cannot be read"),
    ),
    Case(
        "a picture without coordinates",
        text("a.obj", "mtllib m.mtl\n" + one + "usemtl m\nf 1 2 3\n", m_mtl="newmtl m\nKd 1 0 0\nmap_Kd picture.png\n"),
        parts={"m": RED},
        says=(MADE, "no coordinates for it.*: 1"),
    ),
    Case(
        "colours of vertices",
        text("a.obj", coloured + "f 1 2 3\n"),
        parts={"": (1, 1, 1)},
        colours={(0, 0, 0): (MIDDLE, 0, 0), (1, 0, 0): GREEN, (0.5, 0.5, 0): (0, 0.5, 0.5)},
        says=(MADE,),
    ),
    Case(
        "colours up to 255",
        text("a.obj", "v 0 0 0 188 0 0\nv 1 0 0 0 255 0\nv 0 1 0 0 0 255\nf 1 2 3\n"),
        colours={(0, 0, 0): (MIDDLE, 0, 0), (1, 0, 0): GREEN},
        says=(MADE, "up to 255"),
    ),
    Case(
        "colours of some vertices",
        text("a.obj", "v 0 0 0 1 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
        colours={(0, 0, 0): RED, (1, 0, 0): (1, 1, 1)},
        says=(MADE, "without a colour.*: 2"),
    ),
]
