"""Pictures and tables of docs/bodies.md from the catalogue: python docs/draw_bodies.py docs.

What stands in the page between `<!-- NAME:begin -->` and `<!-- NAME:end -->` is written here; the
text around it is not touched. Every number comes from the models.
"""

from __future__ import annotations

import itertools
import sys
from pathlib import Path

import numpy as np
from scipy.optimize import minimize_scalar

import seatdyn as sd
from seatdyn.analysis.seat_factor import seat_factor
from seatdyn.output import style
from seatdyn.output.bodies import body_line, frequency_axis

F = np.geomspace(0.25, 25.0, 301)  # Hz
VIBRATION = [n for n in sd.list_bodies() if sd.load_body(n).group == "vibration"]
ACTIVE = [n for n in VIBRATION if sd.load_body(n).is_active]
PASSIVE = [n for n in VIBRATION if n not in ACTIVE]
REFERENCE = "fairley1989"

SITTING_MASS = 60.0  # kg, of all bodies where seats are compared
FRAME, STIFFNESS = 35.0, 9950.0  # kg, N/m: the paper's seat
DAMPINGS = np.geomspace(200.0, 10e3, 25)  # N s/m, of the picture
SEARCHED = (50.0, 10e3)  # N s/m, for the lowest SEAT factor
SHOWN = ("EM1", "EM3", "EM5", "EM6")
CLASSES = ("EM1", "EM3", "EM5", "EM6", "EM7", "EM8", "EM9")  # EM2, EM4: the shape of EM3
SUSPENSIONS = list(itertools.product((5000.0, 9950.0, 20000.0), (300.0, 600.0, 1200.0, 2400.0)))


# ---------------------------------------------------------------- the catalogue


def card(data, name):
    """Apparent mass and head motion of one body against the range of the published ones."""
    body = sd.load_body(name)
    load = data.apparent_mass / data.mass
    panels = [
        ("apparent mass/mass", abs(load), PASSIVE),
        ("its phase in degrees", phase(load), PASSIVE),
    ]
    if body.head:
        heads = [n for n in PASSIVE if sd.load_body(n).head]
        panels.append(("head/seat", abs(data["head"]), heads))
    figure, axes = style.new_figure(1, len(panels), height=54.0)
    for ax, (label, values, others) in zip(axes, panels, strict=True):
        around = np.array([in_band(values, other) for other in others])
        known = np.any(np.isfinite(around), axis=0)
        ends = [
            end(around, axis=0, where=np.isfinite(around), initial=start)
            for end, start in ((np.min, np.inf), (np.max, -np.inf))
        ]
        ax.fill_between(F, *ends, where=known, color="0.85", linewidth=0.0)
        own = values.sel(body=name).values
        ax.plot(F, own, color=style.COLOURS[0], linestyle=(0, (1, 1.2)), linewidth=1.0)
        ax.plot(F, in_band(values, name), color=style.COLOURS[0])
        ax.set_ylabel(label)
        frequency_axis(ax, F[0], F[-1])
        ax.set_xlabel("frequency in Hz")
        if "phase" not in label:
            ax.set_ylim(bottom=0.0)
    return figure


def phase(values):
    """Phase in degrees without jumps."""
    angle = np.degrees(np.unwrap(np.angle(values.values), axis=1))
    return values.real.copy(data=angle)


def in_band(values, name):
    """Curve of one body, NaN outside the band that its model was made for."""
    low, high = sd.load_body(name).band or (0.0, np.inf)
    return np.where((low <= F) & (high >= F), values.sel(body=name).values, np.nan)


def overview(data):
    """Table of all bodies."""
    yield "| body | mass on the seat in kg | band in Hz | peak in kg | over mass | at Hz | grade |"
    yield "| --- | --- | --- | --- | --- | --- | --- |"
    for name in data.body.values.tolist():
        one, body = data.sel(body=name), sd.load_body(name)
        band = f"{body.band[0]:g} – {body.band[1]:g}" if body.band else "–"
        peak, mass = one.apparent_mass_peak.item(), one.mass.item()
        yield (
            f"| [`{name}`](#{name}) | {mass:g} | {band} | {peak:.1f} | "
            f"{peak / mass:.2f} | {one.apparent_mass_peak_frequency.item():.2f} | "
            f"{body.confidence} |"
        )


def chapter(name):
    """One body: what it is, its numbers, where they come from, its picture."""
    body = sd.load_body(name)
    yield f"### {name}"
    yield ""
    yield f"*{body.title}.* {body.source}."
    yield ""
    facts = [f"Posture: {body.posture}", f"confidence: {body.confidence}"]
    if body.subject_mass and not body.is_active:
        facts.append(f"person of {body.subject_mass:g} kg")
    if body.band:
        facts.append(f"made for {body.band[0]:g} to {body.band[1]:g} Hz")
    yield "; ".join(facts) + "."
    yield ""
    masses = ", ".join(
        f"{'support mass' if node == 'seat' else node} {mass:g} kg"
        for node, mass in body.masses.items()
    )
    yield f"Masses: {masses}."
    yield ""
    yield "| between | stiffness in N/m | damping in N s/m |"
    yield "| --- | --- | --- |"
    for link in body.links:
        yield f"| {' – '.join(link.between)} | {link.stiffness:.10g} | {link.damping:.10g} |"
    yield ""
    if body.feedback:
        for force in body.feedback:
            gains = ", ".join(
                f"{t.name} {t.gain:.10g} {'N/m' if t.of == 'displacement' else 'N s/m'}"
                for t in force.terms
            )
            yield f"Feedback on {force.on}, reversed on {force.reaction}: {gains}."
            yield ""
    yield "| numbers | where they come from |"
    yield "| --- | --- |"
    for group, where in body.provenance.items():
        yield f"| {group.replace('_', ' ')} | {where} |"
    yield ""
    yield f"![Apparent mass and head motion of {name}](images/body_{name}.png)"
    yield ""


def catalogue(data):
    """The generated part about the catalogue."""
    lines = [*overview(data), ""]
    for name in data.body.values.tolist():
        lines += chapter(name)
    return "\n".join(lines).rstrip() + "\n"


# ---------------------------------------------------------------- one seat, many bodies


def factor(name, stiffness, damping, spectrum):
    """SEAT factor of one body at the common sitting mass, NaN without a steady state."""
    seat = sd.Seat(FRAME, [sd.Spring(stiffness), sd.Damper(damping)])
    body = sd.load_body(name).scaled(sitting_mass=SITTING_MASS)
    system = sd.SeatSystem(body, seat)
    return seat_factor(system, sd.seat_test_input(spectrum))


def damping_figure():
    """SEAT over damping for every body."""
    figure, axes = style.new_figure(2, 2, height=125.0, sharex=True)
    ticks = (200, 500, 1000, 2000, 5000, 10000)
    for ax, name in zip(axes, SHOWN, strict=True):
        for i, body in enumerate(VIBRATION):
            look = body_line(i) | {"linewidth": 2.0 if body in ACTIVE else 1.0}
            curve = [factor(body, STIFFNESS, c, name) for c in DAMPINGS]
            ax.plot(DAMPINGS, curve, label=body, **look)
        ax.set_xscale("log")
        ax.set_xticks(ticks, [f"{tick}" for tick in ticks])
        ax.minorticks_off()
        ax.set_ylim(bottom=0.0)
        ax.set_title(name)
        ax.set_ylabel("SEAT factor")
    for ax in axes[2:]:
        ax.set_xlabel("suspension damping in N s/m")
    style.legend_below(figure, axes[0], 4)
    return figure


def best():
    """Table: lowest SEAT factor, the damping that gives it, and what the reference's costs."""
    yield "| body | " + " | ".join(SHOWN) + " |"
    yield "| --- |" + " --- |" * len(SHOWN)
    cells = {body: [] for body in VIBRATION}
    for name in SHOWN:
        found = {body: lowest(body, name) for body in VIBRATION}
        for body, (damping, value) in found.items():
            cost = factor(body, STIFFNESS, found[REFERENCE][0], name) / value - 1.0
            cells[body].append(f"{value:.3f} at {damping:.0f} ({100 * cost:.1f})")
    for body, row in cells.items():
        yield f"| `{body}` | " + " | ".join(row) + " |"


def lowest(body, name):
    """Damping in N s/m with the lowest SEAT factor, and that."""
    found = minimize_scalar(
        lambda x: factor(body, STIFFNESS, np.exp(x), name),
        bounds=np.log(SEARCHED),
        method="bounded",
        options={"xatol": 1e-3},
    )
    return float(np.exp(found.x)), float(found.fun)


def ranking():
    """Table: difference to the reference over all suspensions, pairs in another order."""
    yield "| body | " + " | ".join(CLASSES) + " |"
    yield "| --- |" + " --- |" * len(CLASSES)
    table = {
        (body, name): np.array([factor(body, k, c, name) for k, c in SUSPENSIONS])
        for body in VIBRATION
        for name in CLASSES
    }
    for body in VIBRATION:
        if body != REFERENCE:
            cells = [difference(table[body, name], table[REFERENCE, name]) for name in CLASSES]
            yield f"| `{body}` | " + " | ".join(cells) + " |"
    off, on = ACTIVE
    cells = [difference(table[off, name], table[on, name]) for name in CLASSES]
    yield "| back-off relative to back-on | " + " | ".join(cells) + " |"


def difference(own, other):
    """Range of own/other - 1 in %, number of pairs in another order, and their largest gap in %.

    The gap of a pair is the smaller of what the two bodies say.
    """
    change = 100 * (own / other - 1)
    turned = [
        100 * min(abs(own[a] / own[b] - 1), abs(other[a] / other[b] - 1))
        for a, b in itertools.combinations(range(len(own)), 2)
        if (own[a] - own[b]) * (other[a] - other[b]) < 0.0
    ]
    pairs = f"{len(turned)} of ≤ {max(turned):.1f}" if turned else "0"
    low, high = (f"{round(float(end)):+d}".replace("+0", "0") for end in (min(change), max(change)))
    return f"{low} … {high} ({pairs})"


def seats():
    """The generated part about one seat with many bodies."""
    picture = "![SEAT factor over suspension damping for all bodies](images/seat_bodies.png)"
    return "\n".join([picture, "", LOWEST, "", *best(), "", ORDER, "", *ranking()]) + "\n"


LOWEST = (
    "Lowest SEAT factor, the damping in N s/m that gives it, and in brackets by how many % the "
    "SEAT factor is higher with the damping that is best for `fairley1989`:"
)
ORDER = (
    f"SEAT factor relative to `fairley1989` in %, smallest … largest over {len(SUSPENSIONS)} "
    "suspensions (5, 9.95 and 20 kN/m; 300, 600, 1200 and 2400 N s/m); in brackets how many of "
    f"their {len(SUSPENSIONS) * (len(SUSPENSIONS) - 1) // 2} pairs change order, and the largest "
    "difference in % within such a pair (the smaller of what the two bodies give):"
)


# ---------------------------------------------------------------- into the page


def replaced(page, name, text):
    """The page with the part `name` between its marks exchanged."""
    begin, end = f"<!-- {name}:begin -->\n", f"<!-- {name}:end -->"
    head, _, rest = page.partition(begin)
    _, _, tail = rest.partition(end)
    return f"{head}{begin}\n{text}\n{end}{tail}"


def main(folder: Path) -> None:
    """Write every picture and both generated parts."""
    data = sd.compare_bodies(frequency=F)
    pictures = {f"body_{name}": lambda name=name: card(data, name) for name in data.body.values}
    pictures["seat_bodies"] = damping_figure
    for name, draw in pictures.items():
        png, _ = style.render(draw)
        (folder / "images" / f"{name}.png").write_bytes(png)
    page = folder / "bodies.md"
    text = page.read_text(encoding="utf-8")
    text = replaced(text, "catalogue", catalogue(data))
    page.write_text(replaced(text, "seats", seats()), encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
