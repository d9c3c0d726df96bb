/* Position loops: views of the lab in which a controller moves the mass. */
(function (live) {
  "use strict";
  const { quantity } = live;
  const { value, mass, move, after, largest, risings, withSystem } = live.motion;

  const gains = (Kp, Kd, Ki) => [
    value("Kp", "proportional gain", "N/m", Kp, Kp / 100, Kp * 100, { zero: true }),
    value("Kd", "derivative gain", "N.s/m", Kd, Kd / 100, Kd * (Kd > 50 ? 4 : 100), { zero: true }),
    value("Ki", "integral gain", "N/(m.s)", Ki, Ki / 100, Ki * 100, { zero: true }),
  ];

  const servo = ({ Kp, Kd, Ki, m }) => ({ "pid.Kp": Kp, "pid.Kd": Kd, "pid.Ki": Ki, "axis.m": m });

  const goal = {
    id: "goal",
    title: "Move to a target",
    text: "A PID controller moves a mass to a target, sampled every 2.5 ms.",
    part: "axis",
    controls: [
      ...gains(3, 6, 4),
      value("db", "dead-band: the integral stops while the error is smaller", "m", 0, 1e-3, 0.3, { zero: true }),
      value("goal", "distance of the target", "m", 1, 1e-4, 2),
      mass,
      value("duration", "of the run", "s", 45, 2, 120),
    ],
    charts: [
      { title: "Distance to the target", x: ["time", "s"], y: ["error", "m"], tight: true },
      { title: "Motor force", x: ["time", "s"], y: ["force", "N"], tight: true },
    ],
    loop: (setup) => ({
      values: {
        ...servo(setup), "pid.db": setup.db, "reference.offset": setup.goal,
      },
      duration: setup.duration,
    }),
    compute(run, friction, setup) {
      const found = move(run, friction, this.loop(setup), ["axis.x", "pid.u"]);
      const error = found["axis.x"].map((x) => setup.goal - x);
      const late = after(found.t, error, 0.7 * setup.duration);
      const span = Math.max(...late) - Math.min(...late);
      const crossings = risings(found.t, error, 0).length + risings(found.t, error.map((e) => -e), 0).length;
      const text = span > 0.02 * setup.goal && crossings > 1
        ? "hunts, by up to " + quantity(largest(late), "m")
        : "ends " + quantity(Math.abs(error.at(-1)), "m") + " from the target";
      const zero = { x: found.t, y: found.t.map(() => 0), aside: true, label: "target" };
      const band = setup.db > 0
        ? [1, -1].map((sign) => ({ x: found.t, y: found.t.map(() => sign * setup.db), aside: true, label: "dead-band" }))
        : [];
      return { charts: [[zero, ...band, { x: found.t, y: error }], [{ x: found.t, y: found["pid.u"] }]], text };
    },
  };

  const dither = {
    id: "dither",
    title: "Shaken by dither",
    text: "A PD controller moves a mass towards a target; a fast oscillation is added to its force, sampled every 2.5 ms.",
    part: "axis",
    controls: [
      value("force", "amplitude of the oscillation", "N", 5, 0.1, 20, { zero: true }),
      value("frequency", "frequency of the oscillation", "Hz", 30, 10, 60),
      value("Kp", "proportional gain", "N/m", 300, 30, 3000),
      value("Kd", "derivative gain", "N.s/m", 20, 1, 200),
      value("goal", "distance of the target", "m", 1.5e-3, 1e-5, 1e-2),
      mass,
      value("duration", "of the run", "s", 1.5, 0.2, 3),
    ],
    charts: [
      { title: "Distance to the target", x: ["time", "s"], y: ["error", "m"], tight: true },
      { title: "Friction", x: ["time", "s"], y: ["force", "N"], tight: true },
    ],
    loop: (setup) => ({
      values: {
        ...servo({ ...setup, Ki: 0 }), "reference.offset": setup.goal, "dither.gain": 1, "dither.Ad": setup.force,
        "dither.frequency": setup.frequency, "axis.v0": -setup.force / (2 * Math.PI * setup.frequency * setup.m),
      },
      duration: setup.duration,
    }),
    compute(run, friction, setup) {
      const found = move(run, friction, this.loop(setup), ["axis.x", "friction.F"]);
      const error = found["axis.x"].map((x) => setup.goal - x);
      const late = after(found.t, error, setup.duration - 3 / setup.frequency);
      const mean = late.reduce((sum, each) => sum + each, 0) / late.length;
      return {
        charts: [[{ x: found.t, y: found.t.map(() => 0), aside: true, label: "target" }, { x: found.t, y: error }], [{ x: found.t, y: found["friction.F"] }]],
        text: "ends " + quantity(Math.abs(mean), "m") + " from the target, in the mean",
      };
    },
  };

  const track = {
    id: "track",
    title: "Follow a sine",
    text: "A PID controller moves a mass along a sine, as one axis of a circle does; each reversal is a quadrant.",
    part: "axis",
    controls: [
      value("amplitude", "of the sine", "m", 0.01, 1e-6, 0.1),
      value("frequency", "of the sine", "Hz", 0.16, 0.1, 5),
      value("feedforward", "Coulomb level of a friction curve that is fed forward; 0: none", "N", 0, 0, 3),
      ...gains(12e3, 190, 250e3),
      mass,
    ],
    charts: [
      { title: "Tracking error", x: ["time", "s"], y: ["error", "m"], tight: true },
      { title: "Friction and feedforward", x: ["time", "s"], y: ["force", "N"], tight: true },
    ],
    loop: (setup) => ({
      values: {
        ...servo(setup), "pid.m": setup.m, "reference.amplitude[1]": setup.amplitude, "reference.frequency[1]": setup.frequency,
        "reference.phase[1]": Math.PI / 2, "axis.x0": setup.amplitude, "feedforward.gain": setup.feedforward > 0 ? 1 : 0,
        "feedforward.Fc": setup.feedforward || 1, "feedforward.Fs": 1.5 * (setup.feedforward || 1),
      },
      duration: 2.2 / setup.frequency,
      most: 3000,
    }),
    compute(run, friction, setup) {
      const found = move(run, friction, this.loop(setup), ["axis.x", "reference.r", "friction.F", "feedforward.u"]);
      const from = found.t.findIndex((t) => t >= 0.6 / setup.frequency);
      const t = found.t.slice(from);
      const error = found["reference.r"].map((r, i) => r - found["axis.x"][i]).slice(from);
      return {
        charts: [
          [{ x: t, y: error }],
          [
            { x: t, y: found["feedforward.u"].slice(from), aside: true, label: "feedforward" },
            { x: t, y: found["friction.F"].slice(from) },
          ],
        ],
        text: "largest error " + quantity(largest(error), "m"),
      };
    },
  };

  live.views.push(...[goal, dither, track].map(withSystem));
})(FrictionLive);
