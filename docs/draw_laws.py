"""Draw the pictures of docs/elements.md: python docs/draw_laws.py docs/images."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import seatdyn as sd
from seatdyn.output import style

V = np.linspace(-0.3, 0.3, 601)  # m/s
D = np.linspace(-0.06, 0.06, 601)  # m
FRICTION = {
    "Coulomb, slope 100 s/m": sd.CoulombFriction(40.0, slope=100.0),
    "Stribeck, slope 1000 s/m": sd.StribeckFriction(40.0, 60.0, 0.03),
    "Stribeck, dry": sd.StribeckFriction(40.0, 60.0, 0.03, viscous=100.0, dry=True),
}
DAMPERS = {
    "quadratic": sd.QuadraticDamper(1500.0),
    "power, n = 0.5": sd.PowerDamper(200.0, 0.5, blend=0.01),
    "bump and rebound": sd.AsymmetricDamper(bump=200.0, rebound=500.0),
    "Bingham": sd.BinghamDamper(60.0, 200.0, slope=500.0),
    "tanh, d > 0": sd.TanhDamper(150.0, 0.0, 70.0, 30.0, width=0.5),
}
STOPS = {
    "EndStop": sd.EndStop(60e3, 0.04, 0.04),
    "EndStop with damping": sd.EndStop(60e3, 0.04, 0.04, damping=1500.0),
    "ContactStop, n = 3/2": sd.ContactStop(4e5, 0.04, 0.04),
    "jumping PiecewiseSpring": sd.PiecewiseSpring(8e3, 0.04, 0.04),
}
SPRINGS = {
    "AirSpring": sd.AirSpring(5e5, 4e-3, 6e-4, 1.3),
    "ThreeSpring": sd.ThreeSpring.quasi_zero(8000.0, 8000.0, 0.12),
    "scissor with a spring": sd.ScissorLever(sd.Spring(20e3), 0.4, 0.25),
    "tangent": sd.TangentPolynomialSpring(4000.0, 0.065, (0.0,)),
}


def laws():
    """Force over speed or travel."""
    figure, axes = style.new_figure(2, 2, height=125.0)
    panels = [
        ("friction", FRICTION, V, None),
        ("dampers", DAMPERS, V, None),
        ("stops, moving outwards at 0.2 m/s", STOPS, D, 0.2),
        ("springs", SPRINGS, D, 0.0),
    ]
    for ax, (title, elements, x, speed) in zip(axes, panels, strict=True):
        over_speed = speed is None
        for i, (name, element) in enumerate(elements.items()):
            force = element.force_at(1e-9, x) if over_speed else outwards(element, x, speed)
            ax.plot(x if over_speed else 1e3 * x, force, label=name, **style.line(i))
        ax.set_title(title)
        ax.set_xlabel("velocity in m/s" if over_speed else "travel in mm")
        ax.set_ylabel("force in N")
        ax.legend(loc="lower right" if title in ("friction", "springs") else "upper left")
    return figure


def outwards(element, x, speed):
    """Force on the way from the middle to either end."""
    return element.force_at(x, np.sign(x) * speed)


def balance():
    """Loops of a spring with a damper that cancels it, under a sinusoidal travel."""
    figure, axes = style.new_figure(1, 2, height=62.0)
    angle = np.linspace(0, 2 * np.pi, 2001)
    d, v = 0.03 * np.sin(angle), 0.03 * 12.0 * np.cos(angle)
    loops = {
        "BalanceDamper": sd.BalanceDamper(6000.0, 100.0, 3000.0).force_at(d, v),
        "spring": 6000.0 * d,
    }
    loops["both"] = loops["BalanceDamper"] + loops["spring"]
    for i, (name, force) in enumerate(loops.items()):
        axes[0].plot(1e3 * d, force, label=name, **style.line(i))
    axes[0].set_xlabel("travel in mm")
    axes[0].set_ylabel("force in N")
    axes[0].legend(loc="upper center")
    lever = sd.ScissorLever(sd.Spring(1.0), 0.4, 0.25)
    axes[1].plot(1e3 * D, [lever.ratio(x) for x in D], **style.line(0))
    axes[1].set_title("scissor, arm 0.4 m")
    axes[1].set_xlabel("travel in mm")
    axes[1].set_ylabel("ratio")
    return figure


def loops():
    """Loops of elements with states, growing in amplitude."""
    figure, axes = style.new_figure(1, 3, height=68.0)
    time = np.linspace(0.0, 6.0, 6001)
    growing = 1e-3 * np.ceil(time / 2.0) * np.sin(2 * np.pi * time)
    friction = {
        "Dahl": sd.DahlFriction(30.0, 1e5),
        "LuGre": sd.LuGreFriction(30.0, 45.0, 5e-3, 3e5, 100.0),
    }
    for i, (name, element) in enumerate(friction.items()):
        axes[0].plot(1e3 * growing, element.response(time, growing), label=name, **style.line(i))
    wen = sd.BoucWen(8000.0, 0.1, 400.0, 200.0)
    axes[1].plot(8e3 * growing, wen.response(time, 8 * growing), label="BoucWen", **style.line(0))
    axes[1].set_title("growing cycles at 1 Hz")
    d = 0.01 * np.sin(2 * np.pi * time)
    v = 0.02 * np.pi * np.cos(2 * np.pi * time)
    last = time > 5.0
    for i, volts in enumerate((0.0, 0.75, 1.5)):
        force = sd.SpencerDamper.spencer1997(volts).response(time, d)
        axes[2].plot(v[last], force[last], label=f"Spencer, {volts:g} V", **style.line(i))
    for ax, text in zip(axes, ("travel in mm", "travel in mm", "velocity in m/s"), strict=True):
        ax.set_xlabel(text)
        ax.set_ylim(top=1.35 * ax.get_ylim()[1])
        ax.legend(loc="upper left")
    axes[0].set_ylabel("force in N")
    return figure


def relaxing():
    """Stiffness and damping over frequency, and a skyhook damper in time."""
    figure, axes = style.new_figure(1, 2, height=68.0)
    f = np.geomspace(0.1, 30.0, 200)
    elements = {
        "Zener": sd.Zener(20e3, 15e3, 0.05),
        "AirSpringWithTank": sd.AirSpringWithTank(5e5, 4e-3, 4e-4, 8e-4, 3e7, 1.3),
    }
    for i, (name, element) in enumerate(elements.items()):
        k = element.linearised().stiffness(2j * np.pi * f)
        axes[0].semilogx(f, k.real / 1e3, label=f"{name}, real", **style.line(2 * i))
        axes[0].semilogx(f, k.imag / 1e3, label=f"{name}, imaginary", **style.line(2 * i + 1))
    axes[0].set_xlabel("frequency in Hz")
    axes[0].set_ylabel("stiffness in N/mm")
    axes[0].set_ylim(0.0, 55.0)
    axes[0].legend()
    time = np.linspace(0.0, 2.0, 2001)
    d, w = 0.02 * np.sin(2 * np.pi * time), 0.15 * np.sin(2 * np.pi * time + 0.8)
    axes[1].plot(time, 800.0 * w, label="damper to the sky", **style.line(0))
    for i, control in enumerate(("skyhook", "on-off skyhook")):
        gain = {"gain": 800.0} if control == "skyhook" else {}
        damper = sd.SemiActiveDamper(50.0, 2000.0, 0.003, control=control, **gain)
        force = damper.response(time, d, w=w)
        axes[1].plot(time, force, label=control, **style.line(i + 1))
    axes[1].set_xlim(1.0, 2.0)
    axes[1].set_xlabel("time in s")
    axes[1].set_ylabel("force in N")
    axes[1].set_ylim(top=320.0)
    axes[1].legend(loc="upper left")
    return figure


PICTURES = {
    "laws": laws,
    "laws_lever": balance,
    "laws_loops": loops,
    "laws_relaxing": relaxing,
}


def main(folder: Path) -> None:
    """Write every picture."""
    for name, draw in PICTURES.items():
        png, _ = style.render(draw)
        (folder / f"{name}.png").write_bytes(png)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
