# # What is verified against what
#
# Runs the demos in their default size and prints the table of docs/verification.md.
"""The verification table of docs/verification.md, computed anew."""

from __future__ import annotations

from pathlib import Path

from mpi4py import MPI

import fxcrack as fx
from fxcrack.demos import dcb, dcb3d, enf, enhanced_dcb, front3d, mmb, penny
from fxcrack.demos.show import arguments, table

Line = tuple[str, str, float, float]


def lines(fine: bool = False) -> list[Line]:
    """Case, reference, computed and reference value."""
    out: list[Line] = []
    scene, rows = dcb.run(*((0.125, 16) if fine else (0.25, 8)))
    scene.close()
    for row in (rows[0], rows[-1]):
        out.append((f"DCB 2-D, load at a = {row[0]:.0f}", "corrected beam theory", row[2], row[4]))
    scene, rows = enf.run(*((0.125, 16) if fine else (0.25, 8)))
    scene.close()
    for row in rows[:2]:
        out.append((f"ENF, load at a = {row[0]:.0f}", "corrected beam theory", row[2], row[3]))
    for lever in mmb.LEVERS:
        scene, rows = mmb.run(lever)
        scene.close()
        out.append((f"MMB c = {lever:.0f}, G_I at a = 35", "ASTM D6671", rows[1][2], rows[1][3]))
        out.append((f"MMB c = {lever:.0f}, G_II at a = 35", "ASTM D6671", rows[1][4], rows[1][5]))
    for order, dr in ((1, 0.05), (2, 0.05)):
        scene, found = penny.run(dr, order)
        scene.close()
        out.append((f"penny crack, G, order {order}", "Sneddon 1946", found["G / exact"], 1.0))
    for a in (30, 35):
        found = dcb3d.onset(a)
        published = dcb3d.PUBLISHED[a]
        out.append((f"DCB 3-D, onset a = {a}", "NASA/TM-2008-215123", found["load"], published))
    scene, found = enhanced_dcb.run(0.15)
    scene.close()
    out.append(("enhanced VCCT, dissipated", "toughness given", found["dissipated"], 0.15))
    scene, found = front3d.run(fx.ProgressiveRelease())
    scene.close()
    out.append(("progressive 3-D, dissipated", "toughness given", found["dissipated"], 0.20))
    return out


def main(out: Path, fine: bool = False) -> None:
    """Print the table and write it as Markdown."""
    found = lines(fine)
    rows = [[case, against, got, want, f"{100.0 * (got / want - 1.0):+.2f} %"]
            for case, against, got, want in found]  # fmt: skip
    table("Verified", ["case", "against", "fxcrack", "reference", "difference"], rows)
    if MPI.COMM_WORLD.rank == 0:
        out.mkdir(parents=True, exist_ok=True)
        text = ["| case | against | fxcrack | reference | difference |", "|---|---|---|---|---|"]
        text += [
            f"| {case} | {against} | {got:.5g} | {want:.5g} | {100.0 * (got / want - 1.0):+.2f} % |"
            for case, against, got, want in found
        ]
        (out / "verification.md").write_text("\n".join(text) + "\n")


if __name__ == "__main__":
    main(*arguments(__doc__, "out/verify"))
