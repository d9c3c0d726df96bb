/* The state of the lab as an address, as TOML, as Python and as a command. */
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

  /* Return a system file: the loop with the values of a run, or the friction model alone under a mass. */
  function toToml(model, changed, run) {
    if (!run) {
      return (
        'wires = ["mass.v -> friction.v", "friction.F -> mass.F_friction"]\n\n[experiment]\nstop = 1.0\nstep = 1e-3\n\n' +
        '[parts.mass]\nmodel = "Mass"\nstart = { F_drive = 1.0 }\n\n[parts.friction]\nmodel = "' + model + '"\n' +
        (Object.keys(changed).length ? "start = { " + table(changed) + " }\n" : "")
      );
    }
    const parts = byPart({ ...run.values, ...Object.fromEntries(Object.entries(changed).map(([name, value]) => ["friction." + name, value])) });
    const sections = run.toml.replace(/\n# .*|^# .*\n/g, "").split(/\n(?=\[parts\.)/);
    return sections.map((section) => {
      const name = (/^\[parts\.(\w+)\]/.exec(section) || [])[1];
      if (!name) return (run.note ? "# " + run.note + "\n" : "") + section.replace(/stop = .*/, "stop = " + number(run.duration));
      const lines = section.trimEnd().split("\n").filter((line) => !line.startsWith("start"));
      return [...lines, ...(parts[name] ? ["start = { " + table(parts[name]) + " }"] : []), ""].join("\n");
    }).join("\n");
  }

  /* Return a Python program that runs a system file, or moves the friction model. */
  function toPython(model, changed, run) {
    if (!run) {
      const values = Object.entries(changed).map(([name, value]) => '"friction.' + name + '": ' + number(value)).join(", ");
      return (
        'from friction_fmus import fmu\nfrom friction_fmus.harness import FmuPart, System\n\n' +
        'parts = [FmuPart("mass", fmu("Mass")), FmuPart("friction", fmu("' + model + '"))]\n' +
        'wires = ["mass.v -> friction.v", "friction.F -> mass.F_friction"]\n' +
        'start = {"mass.F_drive": 1.0' + (values ? ", " + values : "") + "}\n" +
        "with System(parts, wires, start) as system:\n    result = system.run(stop=1.0, step=1e-3)\n"
      );
    }
    return (
      "from pathlib import Path\n\nfrom friction_fmus import fmu\nfrom friction_fmus.harness import System\n\n" +
      'Path("axis.toml").write_text(\n    """' + toToml(model, changed, run) + '"""\n)\n' +
      'with System.from_toml("axis.toml", resolve=fmu, open_inputs=True) as system:\n    result = system.run()\n'
    );
  }

  /* Return the command that builds the friction model with these parameters. */
  function toCommand(model, changed) {
    const values = Object.entries(changed).map(([name, value]) => " --set " + (/\[/.test(name) ? '"' + name + "=" + value + '"' : name + "=" + value));
    return "friction-fmus build " + model + " -o fmus" + (values.length ? " --name My" + model + values.join("") : "");
  }

  live.share = { toHash, fromHash, ofPreset, toToml, toPython, toCommand };
})(FrictionLive);
