/* The state of the lab as an address, as TOML, as Python and as commands. */
(function (live) {
  "use strict";
  const PREFIX = { setup: "s.", first: "a.", second: "b." };

  /* Return a state as the part of an address behind #. Values equal to the start values are left out. */
  function toHash(state) {
    const parts = ["view=" + state.view, "models=" + state.models.filter(Boolean).join(",")];
    for (const [group, prefix] of Object.entries(PREFIX)) {
      for (const [name, value] of Object.entries(state[group])) parts.push(prefix + encodeURIComponent(name) + "=" + value);
    }
    return "#" + parts.join("&");
  }

  /* Return the state in an address, or null if it has none. Unknown names and values that are no numbers are ignored. */
  function fromHash(hash) {
    const parts = new URLSearchParams(hash.slice(1));
    const preset = live.presets.find((each) => each.id === parts.get("preset"));
    if (preset) return ofPreset(preset);
    if (!live.views.some((view) => view.id === parts.get("view"))) return null;
    const models = (parts.get("models") || "").split(",").filter((name) => live.catalogue.models.includes(name)).slice(0, 2);
    const state = { view: parts.get("view"), models: models.length ? models : ["LuGre"], setup: {}, first: {}, second: {} };
    for (const [group, prefix] of Object.entries(PREFIX)) {
      for (const [name, value] of parts) {
        if (name.startsWith(prefix) && value.trim() !== "" && isFinite(value)) state[group][name.slice(2)] = Number(value);
      }
    }
    return state;
  }

  function ofPreset({ view, models, setup = {}, first = {}, second = {} }) {
    return { view, models: [...models], setup: { ...setup }, first: { ...first }, second: { ...second } };
  }

  const number = (value) => (Number.isInteger(value) && Math.abs(value) < 1e6 ? value.toFixed(1) : String(value));
  const key = (name) => (/^[\w-]+$/.test(name) ? name : JSON.stringify(name));
  const table = (values) => Object.entries(values).map(([name, value]) => key(name) + " = " + number(value)).join(", ");

  /* Return values as start values of parts: {"pid.Kp": 3} -> {pid: {Kp: 3}}. */
  function byPart(values) {
    const found = {};
    for (const [name, value] of Object.entries(values)) {
      const [part, ...rest] = name.split(".");
      (found[part] ||= {})[rest.join(".")] = value;
    }
    return found;
  }

  /* Return a system file: the loop of a view with the values of a run. */
  function toToml({ changed, toml }, run) {
    const parts = byPart({ ...run.values, ...ofFriction(changed) });
    const sections = toml.replace(/\n# .*|^# .*\n/g, "").split(/\n(?=\[parts\.)/);
    return sections.map((section) => {
      const name = (/^\[parts\.(\w+)\]/.exec(section) || [])[1];
      if (!name) return section.replace(/stop = .*/, "stop = " + number(run.duration));
      const lines = section.trimEnd().split("\n").filter((line) => !line.startsWith("start"));
      return [...lines, ...(parts[name] ? ["start = { " + table(parts[name]) + " }"] : []), ""].join("\n");
    }).join("\n");
  }

  const ofFriction = (changed) => Object.fromEntries(Object.entries(changed).map(([name, value]) => ["friction." + name, value]));
  const dict = (values) => "{" + Object.entries(values).map(([name, value]) => JSON.stringify(name) + ": " + number(value)).join(", ") + "}";
  const without = (values, others) => Object.fromEntries(Object.entries(values).filter(([name]) => !(name in others)));
  const pairs = (sides, given = {}) => "models = [\n" + sides.map(({ model, changed, inputs }) =>
    "    (" + JSON.stringify(model) + ", " + dict({ ...without(inputs, given), ...ofFriction(changed) }) + "),\n").join("") + "]\n";

  /* Return a Python program that runs the loop of a view with each model, and draws a variable. */
  function toPython(sides, run) {
    const [{ toml }] = sides;
    const wires = /wires = \[([^]*?)\]/.exec(toml)[1].match(/"[^"]*"/g);
    const parts = [...toml.matchAll(/\[parts\.(\w+)\]\nmodel = ("\w+")/g)].map(([, part, model]) =>
      'FmuPart("' + part + '", ' + (part === "friction" ? "name" : model) + ")");
    if (run.python) {
      parts.push('SeriesPart("push", t, {"F": push}, {"F": "N"})');
      wires.push('"push.F -> axis.F_load"');
    }
    const step = /\nstep = (\S+)/.exec(toml)[1];
    return (
      "import matplotlib.pyplot as plt\n" + (run.python ? "import numpy as np\n" : "") + "\n" +
      "from friction_fmus import FmuPart, " + (run.python ? "SeriesPart, " : "") + "System\n\n" +
      pairs(sides, run.values) + "start = " + dict(run.values) + "\nwires = [\n" + wires.map((wire) => "    " + wire + ",\n").join("") + "]\n" +
      (run.python ? "t = np.arange(0.0, " + number(run.duration + Number(step)) + ", " + step + ")\npush = " + run.python + "\n" : "") +
      "for name, parameters in models:\n    parts = [\n" + parts.map((part) => "        " + part + ",\n").join("") + "    ]\n" +
      "    with System(parts, wires, start | parameters) as system:\n" +
      "        result = system.run(stop=" + number(run.duration) + ", step=" + step + ', master="newton")\n' +
      '    result["axis.x"].plot(label=name)\nplt.legend()\nplt.show()\n'
    );
  }

  /* Return a Python program that moves each model as the lab does: at steady velocities, and along a path. */
  function ofContact(sides, { fastest, amplitude, detour, speed }, reach) {
    const pushed = sides.filter((each) => each.pushed).map((each) => each.model);
    return (
      "import matplotlib.pyplot as plt\nimport numpy as np\n\n" +
      "from friction_fmus import FmuPart, SeriesPart, System\n\n" +
      pairs(sides) + "fastest, speed = " + number(fastest) + ", " + number(speed) + "  # m/s\n" +
      "amplitude, reach = " + number(amplitude) + ", " + number(reach) + "  # m\n" +
      "turns = amplitude * np.array([0.0, 1.0, -1.0, 0.3, 0.3 - " + number(detour) + ", 1.0, -1.0])\n" +
      "step = amplitude / 60 / speed\ncounts = np.rint(np.diff(turns) / (step * speed)).astype(int)\n" +
      "v = speed * np.concatenate([np.full(abs(n), np.sign(n)) for n in counts] + [[0]])\nt = step * np.arange(v.size)\n" +
      "velocities = np.linspace(-fastest, fastest, 60)\n\n\n" +
      "def moved(name, parameters, t, v):\n" +
      '    motion = SeriesPart("motion", t, {"v": v, "F": 1e4 * np.sign(v)}, {"v": "m/s", "F": "N"}, interpolation="previous")\n' +
      '    wires = ["motion.v -> friction.v"]\n' +
      (pushed.length ? "    if name in " + JSON.stringify(pushed) + ':  # friction at rest needs the force\n        wires.append("motion.F -> friction.F_ext")\n' : "") +
      '    with System([motion, FmuPart("friction", name)], wires, parameters) as system:\n' +
      '        return system.run(stop=t[-1], step=t[1])["friction.F"].to_numpy()\n\n\n' +
      "figure, (left, right) = plt.subplots(1, 2)\n" +
      "for name, parameters in models:\n" +
      "    ends = [8 * reach / abs(each) + 1e-3 for each in velocities]\n" +
      "    steady = [moved(name, parameters, end / 20 * np.arange(21), np.full(21, each))[-1] for each, end in zip(velocities, ends)]\n" +
      "    left.plot(velocities, steady, label=name)\n" +
      "    result = moved(name, parameters, t, v)\n" +
      "    right.plot(np.concatenate([[0.0], np.cumsum(v[:-1] * step)]), result, label=name)\n" +
      'left.set(xlabel="velocity [m/s]", ylabel="friction [N]")\nright.set(xlabel="displacement [m]")\nright.legend()\nplt.show()\n'
    );
  }

  /* Return the command that builds the friction model with these parameters. */
  function toCommand({ model, changed }) {
    const values = Object.entries(changed).map(([name, value]) => " --set " + (/\[/.test(name) ? '"' + name + "=" + value + '"' : name + "=" + value));
    return "friction-fmus build " + model + " -o fmus" + (values.length ? " --name My" + model + values.join("") : "");
  }

  live.share = { toHash, fromHash, ofPreset, toToml, toPython, ofContact, toCommand };
})(FrictionLive);
