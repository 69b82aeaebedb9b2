# # Centre crack: critical stress, critical opening, crack length against time
#
# A wide plate with a crack from x = -a to x = a. Under a remote tension s the stress ahead of the
# crack and the opening behind its tip are known, K factor of a plate of finite width included:
#
#     s_yy(a + d) = k s (a + d)/sqrt((a + d)^2 - a^2),      w(a - n) = k 4 s/E' sqrt(2 a n - n^2),
#     k = sqrt(sec(pi a/W)),      E' = E/(1 - nu^2)
#
# so the load at which either reaches its critical value is known too. That is the first table.
#
# The second is a circle. A pressure on the middle of the crack makes it grow steadily. The critical
# stress decides, and the history tells the opening behind the tip and the crack length at every
# release. These are the tables of the other two criteria: they must let the same nodes go at the
# same times. Units N, mm.
"""Centre crack: three criteria against closed forms, and against each other."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

import fxcrack as fx
from fxcrack.demos.show import arguments, table
from fxcrack.meshes.center_crack import center_crack

E, NU, A = 200e3, 0.3, 1.0
STRENGTH = 100.0
AHEAD, BEHIND = 0.2, 0.2

Criterion = fx.CriticalStress | fx.CrackOpening | fx.CrackLengthVsTime


def make_scene(
    criterion: Criterion,
    *,
    n_crack: int = 20,
    width: float = 40.0,
    order: int = 1,
    remote: bool = True,
    watch: Sequence[Criterion] = (),
    release: fx.StepRelease | fx.AmplitudeRelease | None = None,
) -> fx.Scene:
    """The plate under a remote tension of 1 at time 1, or a pressure of 1 on the crack's middle."""
    mesh = center_crack(
        a=A, width=width, height=width, n_crack=n_crack, fine=A, growth=1.25, order=order
    )
    bond = fx.Interface(
        slave="upper_face",
        master="lower_face",
        bonded=lambda x: np.abs(x[0]) >= A * (1.0 - 1e-9),
        name="bond",
    )

    def middle(x: np.ndarray) -> np.ndarray:
        return np.where(np.abs(x[0]) < 0.5 * A, 1.0, 0.0)

    if remote:
        loads = [fx.Traction("top", (0.0, 1.0)), fx.Traction("bottom", (0.0, -1.0))]
    else:
        loads = [fx.Pressure("upper_face", middle), fx.Pressure("lower_face", middle)]
    return fx.Scene(
        mesh,
        materials=fx.Isotropic(E, NU),
        model=fx.PlaneStrain(),
        supports=[
            fx.Displacement("bottom_left", x=0.0, y=0.0),
            fx.Displacement("bottom_right", y=0.0),
        ],
        loads=loads,
        debonds=[fx.Debond(bond, criterion, release or fx.StepRelease(), watch)],
    )


def onset(criterion: Criterion, n_crack: int, width: float = 40.0, order: int = 1) -> float:
    """Remote tension at which the first nodes go."""
    scene = make_scene(criterion, n_crack=n_crack, width=width, order=order)
    history = scene.run(fx.Static(until=fx.Releases(1)))
    scene.close()
    return float(next(r["time"] for r in history if r["event"] == "onset"))


def onset_errors(
    n_crack: int, ahead: float = AHEAD, behind: float = BEHIND, width: float = 40.0, order: int = 1
) -> tuple[float, float]:
    """Onset loads of critical stress and critical opening over the closed forms, minus 1."""
    k = np.sqrt(1.0 / np.cos(np.pi * A / width))
    stress = STRENGTH * np.sqrt((A + ahead) ** 2 - A**2) / (A + ahead) / k
    found = onset(fx.CriticalStress(STRENGTH, distance=ahead), n_crack, width, order)
    opening = 4.0 * (1.0 - NU**2) / E * np.sqrt(2.0 * A * behind - behind**2) * k
    critical = fx.CrackOpening(STRENGTH * opening, distance=behind)
    return found / stress - 1.0, onset(critical, n_crack, width, order) / STRENGTH - 1.0


def onsets(history: fx.History, *columns: str) -> list[np.ndarray]:
    """Columns of a history at the states just before nodes went."""
    at = np.isin(history["event"], ["onset", "unstable"])
    return [history[c][at].astype(float) for c in columns]


def run(
    n_crack: int = 20, releases: int = 8, order: int = 1, width: float = 20.0
) -> tuple[list[fx.Scene], np.ndarray]:
    """The circle; scenes, and columns a, time of release by stress, by opening, by length."""
    end = fx.Static(until=fx.Releases(2 * order * releases))
    common = {"n_crack": n_crack, "width": width, "order": order, "remote": False}
    probe = fx.CrackOpening(1.0, distance=BEHIND)  # its value decides nothing
    stress = make_scene(fx.CriticalStress(STRENGTH, distance=AHEAD), watch=[probe], **common)
    stress.run(end)
    time, a, cod = onsets(stress.history, "time", "a[bond]", "cod[bond]")

    opening = make_scene(fx.CrackOpening((a - a[0], cod), distance=BEHIND), **common)
    opening.run(end)
    # the mean of all nodes of the upper face is the middle of the crack
    length = make_scene(fx.CrackLengthVsTime(time, a, reference="upper_face"), **common)
    length.run(end)
    scenes = [stress, opening, length]
    return scenes, np.array([a, *(onsets(s.history, "time")[0] for s in scenes)]).T


def main(out: Path, fine: bool = False) -> None:
    """Both tables, the histories and a picture of load against crack length."""
    rows, last = [], np.full(2, np.nan)
    for n in (10, 20, 40, 80) if fine else (10, 20, 40):
        now = np.array(onset_errors(n))
        rates = np.log2(last / now)
        rows.append([str(n), 100 * now[0], rates[0], 100 * now[1], rates[1]])
        last = now
    table(
        "Onset load beside the closed forms",
        ["elements per a", "stress: error / %", "rate", "opening: error / %", "rate"],
        rows,
    )
    scenes, times = run(40 if fine else 20)
    # columns: a, then the pressure at release by each criterion
    a, stress, opening, length = times.T
    table(
        "Pressure at release, and how the other criteria differ",
        ["a / mm", "by critical stress / MPa", "by opening: relative", "by length: relative"],
        np.array([a, stress, opening / stress - 1.0, length / stress - 1.0]).T.tolist(),
    )
    for name, scene in zip(("stress", "opening", "length"), scenes, strict=True):
        scene.history.to_csv(out / f"center_crack_{name}.csv")
    others = [
        (f"critical {name}", s.history["a[bond]"], s.history["time"])
        for name, s in zip(("opening", "length"), scenes[1:], strict=True)
    ]
    scenes[0].history.plot(
        out / "load_length.png",
        x="a[bond]",
        y="time",
        xlabel="half crack length a / mm",
        ylabel="pressure / MPa",
        label="critical stress",
        reference=others,
    )


if __name__ == "__main__":
    main(*arguments(__doc__, "out/center_crack"))
