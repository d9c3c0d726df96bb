/* What the lab computes: each view runs a model and returns curves and a sentence about them. */
(function (live) {
  "use strict";
  const TICKS = { mass: 5e-3, axis: 2.5e-3 }; /* steps inside the systems, in mass.toml and axis.toml [s] */
  const FEWEST = 600; /* steps of a run; the systems divide their own steps for it */
  const value = (name, text, unit, start, min, max, more = {}) => ({ name, text, unit, start, min, max, ...more });
  const { quantity } = live;

  /* ---- the block alone, moved along a path --------------------------------------------------------------------- */

  /* Return the inputs of a block that is moved: a force on it is large enough to break away. */
  function moving(run, velocity, force) {
    const push = typeof velocity === "number" ? Math.sign(velocity) * force : velocity.map((v) => Math.sign(v) * force);
    return run.has("F_ext") ? { v: velocity, F_ext: push } : { v: velocity };
  }

  function pushing(values) {
    return 10 * Math.max(1, ...Object.values(values).filter((each) => Math.abs(each) < 1e3));
  }

  /* Friction at steady velocities: each is held until the force no longer changes. */
  function sliding(run, values, fastest, reach) {
    const speeds = Array.from({ length: 44 }, (_, i) => fastest * Math.pow(1 - i / 44, 2.5));
    const halves = [1, -1].map((direction) => {
      run.begin(values);
      return speeds.map((speed) => {
        const v = direction * speed;
        let before, F;
        for (let time = (5 * reach) / speed + 1e-3, i = 0; i < 5; i++, time *= 2) {
          const found = run.advance(time / 4, 4, moving(run, v, pushing(values)), ["F"]).F;
          before = F;
          F = (found[1] + found[2] + found[3] + found[4]) / 4;
          if (Math.abs(F - before) < 1e-4 * Math.abs(F)) break;
        }
        return [v, F];
      });
    });
    const points = [...halves[1], ...halves[0].reverse()];
    return { x: Float64Array.from(points, (p) => p[0]), y: Float64Array.from(points, (p) => p[1]) };
  }

  /* A path in steps of one length through these turning points. */
  function path(turns, length) {
    const signs = [];
    for (let i = 1; i < turns.length; i++) {
      const steps = Math.round((turns[i] - turns[i - 1]) / length);
      for (let k = 0; k < Math.abs(steps); k++) signs.push(Math.sign(steps));
    }
    return signs;
  }

  /* Friction over a path with a detour, and without: a model with memory closes the inner loop. */
  function loop(run, values, { amplitude, detour, speed }) {
    const length = amplitude / 60;
    const turn = 0.3 * amplitude;
    const signs = path([0, amplitude, -amplitude, turn, turn - detour * amplitude, amplitude, -amplitude], length);
    const v = Float64Array.from([...signs, 0], (sign) => sign * speed);
    run.begin(values);
    const F = run.advance(length / speed, v.length - 1, moving(run, v, pushing(values)), ["F"]).F;
    const x = new Float64Array(v.length);
    for (let i = 1; i < x.length; i++) x[i] = x[i - 1] + length * signs[i - 1];
    const there = 60 + 120 + 78; /* steps to the turning point of the detour */
    return { x, y: F, miss: F[there] - F[there + 2 * Math.round(60 * detour)] };
  }

  const contact = {
    id: "contact",
    title: "Force over velocity and path",
    text: "The contact alone is moved: at steady velocities, and slowly to and fro with an inner loop.",
    part: "block",
    controls: [
      value("fastest", "highest velocity", "m/s", 5e-3, 1e-5, 1),
      value("amplitude", "amplitude of the path", "m", 2e-5, 1e-7, 1e-2),
      value("detour", "inner loop, as a part of the amplitude", "", 0.8, 0, 1.2),
      value("speed", "speed along the path", "m/s", 1e-5, 1e-7, 1e-2),
    ],
    charts: [
      { title: "Steady sliding", x: ["velocity", "m/s"], y: ["friction", "N"] },
      { title: "Presliding with an inner loop", x: ["displacement", "m"], y: ["friction", "N"] },
    ],
    compute(run, values, setup) {
      const curve = sliding(run, values, setup.fastest, run.about.reach);
      const hysteresis = loop(run, values, setup);
      const most = Math.max(...curve.y);
      const text = "has up to " + quantity(most, "N") + " of friction, " + quantity(curve.y.at(-1), "N") + " at " + quantity(setup.fastest, "m/s") +
        (setup.detour > 0 && run.about.features.includes("presliding") ? Math.abs(hysteresis.miss) < 1e-3 * most
          ? "; after the inner loop, the force returns to its value at the reversal" : "; after the inner loop, the force is off its value at the reversal by " + quantity(Math.abs(hysteresis.miss), "N") + " (no nonlocal memory)" : "");
      return { charts: [[curve], [hysteresis]], text };
    },
  };

  /* ---- a mass on the contact, in a composite with the loop solved inside --------------------------------------- */

  const IDLE = {
    "pid.Kp": 0, "pid.Kd": 0, "pid.Ki": 0, "pid.Ts": TICKS.axis, "feedforward.gain": 0, "feedforward.Ts": TICKS.axis,
    "feedforward.m": 0, "dither.gain": 0, "dither.frequency": 30, "dither.Ts": TICKS.axis, "dither.u_min": -1e6, "dither.u_max": 1e6,
    "reference.amplitude[1]": 0, "reference.offset": 0, "pid.db": 0, "pid.db_ratio": 1, "pid.m": 0,
  };
  const REST = { "axis.k": 0, "axis.d": 0, "axis.v_support": 0, "axis.x0": 0, "axis.v0": 0, "axis.F_load": 0 };

  /* Return times at equal steps: some ticks of the system, or parts of a tick if the run is short. */
  function rows(duration, tick, most = 1500) {
    const ticks = Math.round(duration / tick);
    const step = ticks < FEWEST ? duration / FEWEST : Math.ceil(ticks / most) * tick;
    return { step, t: Float64Array.from({ length: Math.floor(duration / step + 1e-6) + 1 }, (_, i) => i * step) };
  }

  /* Run the loop of a view: what its parts are set to, how long it runs, and a force on the mass over time. */
  function move(run, friction, { values, duration, force, most }, outputs) {
    const servo = run.has("pid.Kp");
    const { step, t } = rows(duration, servo ? TICKS.axis : TICKS.mass, most);
    run.begin({ ...REST, ...(servo ? IDLE : {}), ...values, ...friction });
    const inputs = force ? { "axis.F_load": t.map(force) } : {};
    return { t, ...run.advance(step, t.length - 1, inputs, outputs, Boolean(force)) };
  }

  const after = (t, y, since) => y.filter((_, i) => t[i] >= since);
  const largest = (y) => y.reduce((most, each) => Math.max(most, Math.abs(each)), 0);

  /* Return the times at which a series rises through a level. */
  function risings(t, y, level) {
    const found = [];
    for (let i = 1; i < t.length; i++) {
      if (y[i - 1] < level && y[i] >= level) found.push(t[i - 1] + ((level - y[i - 1]) / (y[i] - y[i - 1])) * (t[i] - t[i - 1]));
    }
    return found;
  }

  const mass = value("m", "mass", "kg", 1, 0.01, 100);

  const breakAway = {
    id: "break-away",
    title: "Break-away",
    text: "The force on a mass grows steadily until the mass slides.",
    part: "mass",
    controls: [value("rate", "growth of the force", "N/s", 2, 0.02, 200), value("top", "largest force", "N", 2, 0.1, 20), mass],
    charts: [
      { title: "Force", x: ["time", "s"], y: ["force", "N"], tight: true },
      { title: "Displacement until break-away", x: ["time", "s"], y: ["displacement", "m"], tight: true },
    ],
    loop: ({ rate, top, m }) => ({
      values: { "axis.m": m },
      duration: Math.min((1.2 * top) / rate, 40),
      force: (t) => Math.min(rate * t, top),
      python: "np.minimum(" + rate + " * t, " + top + ")",
    }),
    compute(run, friction, setup) {
      const loop = this.loop(setup);
      const found = move(run, friction, loop, ["axis.x", "friction.F"]);
      const most = found["friction.F"].indexOf(Math.max(...found["friction.F"]));
      const limit = Math.max(2.5 * found["axis.x"][most], 1e-7);
      const shown = found["axis.x"].map((x) => (x > limit ? NaN : x));
      const slides = found["axis.x"][found["axis.x"].length - 1] > limit;
      return {
        charts: [
          [{ x: found.t, y: found.t.map(loop.force), label: "applied force", aside: true }, { x: found.t, y: found["friction.F"] }],
          [{ x: found.t, y: shown }],
        ],
        text: slides
          ? "breaks away at " + quantity(found["friction.F"][most], "N") + ", after " + quantity(found["axis.x"][most], "m")
          : "holds the mass, which moved by " + quantity(found["axis.x"].at(-1), "m"),
      };
    },
  };

  const CYCLES = 20; /* of the vibration */

  const hold = {
    id: "hold",
    title: "Held under vibration",
    text: "A constant force with a small vibration pushes a mass: friction should hold it.",
    part: "mass",
    controls: [
      value("bias", "constant force", "N", 0.6, 0, 3),
      value("vibration", "amplitude of the vibration", "N", 0.3, 0, 2),
      value("frequency", "frequency of the vibration", "Hz", 1, 0.2, 20),
      mass,
    ],
    charts: [
      { title: "Displacement", x: ["time", "s"], y: ["displacement", "m"], tight: true },
      { title: "Applied force", x: ["time", "s"], y: ["force", "N"], tight: true },
    ],
    loop: ({ bias, vibration, frequency, m }) => ({
      values: { "axis.m": m },
      duration: 1 + CYCLES / frequency,
      force: (t) => (t < 1 ? bias * t : bias + vibration * Math.sin(2 * Math.PI * frequency * (t - 1))),
      most: 12000,
      python: "np.where(t < 1, " + bias + " * t, " + bias + " + " + vibration + " * np.sin(2 * np.pi * " + frequency + " * (t - 1)))",
    }),
    compute(run, friction, setup) {
      const loop = this.loop(setup);
      const found = move(run, friction, loop, ["axis.x"]);
      const at = (t) => found["axis.x"][Math.min(Math.round(t / (found.t[1] - found.t[0])), found.t.length - 1)];
      const drift = (at(loop.duration) - at((loop.duration + 1) / 2)) / (CYCLES / 2);
      return {
        charts: [[{ x: found.t, y: found["axis.x"] }], [{ x: found.t, y: found.t.map(loop.force), label: "applied force", aside: true }]],
        text: Math.abs(drift) < 1e-12 ? "no drift" : "drifts by " + quantity(drift, "m") + " per cycle",
      };
    },
  };

  const stickSlip = {
    id: "stick-slip",
    title: "Stick-slip",
    text: "A belt moves under a mass that a spring holds: the same as a spring whose end is pulled, as it is drawn here.",
    part: "mass",
    controls: [
      value("speed", "speed of the belt", "m/s", 0.1, 1e-3, 1),
      value("k", "stiffness of the spring", "N/m", 2, 0.1, 1000),
      value("d", "damping beside the spring", "N.s/m", 0, 0.01, 10, { zero: true }),
      mass,
      value("duration", "of the run", "s", 25, 2, 30),
    ],
    charts: [
      { title: "Speed of the mass", x: ["time", "s"], y: ["velocity", "m/s"], tight: true },
      { title: "Force of the spring", x: ["time", "s"], y: ["force", "N"], tight: true },
    ],
    loop: ({ speed, k, d, m, duration }) => ({
      values: { "axis.v_support": speed, "axis.k": k, "axis.d": d, "axis.m": m },
      duration,
    }),
    compute(run, friction, setup) {
      const { speed, k, duration } = setup;
      const found = move(run, friction, this.loop(setup), ["axis.x", "axis.v", "axis.x_support"]);
      const pull = found["axis.x"].map((x, i) => k * (found["axis.x_support"][i] - x));
      const slips = risings(found.t, found["axis.v"], 0.5 * speed);
      const stuck = after(found.t, found["axis.v"], duration / 2);
      const sticks = stuck.filter((v) => Math.abs(v) < 0.01 * speed).length > 0.1 * stuck.length && slips.length > 1;
      const period = (slips.at(-1) - slips[1]) / (slips.length - 2);
      return {
        charts: [
          [
            { x: found.t, y: found.t.map(() => speed), label: "belt", aside: true },
            { x: found.t, y: found["axis.v"] },
          ],
          [{ x: found.t, y: pull }],
        ],
        text: sticks
          ? "sticks and slips" + (slips.length > 2 ? ", every " + quantity(period, "s") : "") + ", up to " + quantity(largest(found["axis.v"]), "m/s")
          : slips.length > 2 && largest(stuck.map((v) => v - speed)) > 0.05 * speed ? "oscillates without sticking" : "slides steadily",
      };
    },
  };

  /* Return a view whose `system` is what a system file of it has. */
  function withSystem(view) {
    const idle = view.part === "axis" ? IDLE : { "axis.F_drive": 0 };
    view.system = (setup) => {
      const loop = view.loop(setup);
      return { ...loop, values: { ...idle, ...loop.values } };
    };
    return view;
  }

  live.views = [contact, ...[breakAway, hold, stickSlip].map(withSystem)];
  Object.assign(live, { moving, pushing, motion: { value, mass, move, after, largest, risings, withSystem } });
})(FrictionLive);
