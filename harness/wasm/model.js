/**
 * FMUs of friction-fmus as WebAssembly modules: a `Model` is a loaded module, a `Block` one instance of it.
 * The module has no imports; this file runs in browsers, workers and Node.
 */

const REAL = "Real", INTEGER = "Integer", BOOLEAN = "Boolean";
const TYPES = [REAL, INTEGER, BOOLEAN];
const kind = (variable) => (variable.type === "Enumeration" ? INTEGER : variable.type);
const WARNING = 1;
const STATUS = ["ok", "warning", "discard", "error", "fatal"];
const SCRATCH = 32; // bytes for one value reference and one value

/** The FMU has rejected a call; the message is its own. The block is as it was before the call. */
export class FmuError extends Error {
  constructor(message, status) {
    super(message);
    this.name = "FmuError";
    this.status = status;
  }
}

/** A loaded module with the description of its variables. */
export class Model {
  #exports;
  #scratch;

  /**
   * Load a module.
   * @param source URL, bytes, Response or WebAssembly.Module
   * @param description the content of NAME.json
   */
  static async load(source, description) {
    const found = source instanceof WebAssembly.Module ? source : await WebAssembly.compile(await bytesOf(source));
    return new Model(await WebAssembly.instantiate(found, {}), description);
  }

  constructor(instance, description) {
    this.#exports = instance.exports;
    this.#exports._initialize();
    this.#scratch = this.#exports.malloc(SCRATCH);
    this.description = description;
    this.name = description.name;
    this.variables = new Map(description.variables.map((variable) => [variable.name, variable]));
  }

  /**
   * Make an instance at its start time.
   * @param start start values of parameters, states and inputs by name
   * @param options `startTime` and `tolerance`
   */
  instantiate(start = {}, { startTime = 0, tolerance } = {}) {
    return new Block(this, this.#exports, this.#scratch, start, { startTime, tolerance });
  }

  /** Return the variables with a name: one, or the elements of an array. */
  find(name) {
    const variable = this.variables.get(name);
    if (variable) return [variable];
    const elements = this.description.arrays[name];
    if (elements) return elements.map((element) => this.variables.get(element));
    const known = [...this.variables.keys(), ...Object.keys(this.description.arrays)];
    throw new RangeError(`${this.name} has no variable "${name}"${suggestion(String(name), known)}`);
  }
}

/** One instance of a model. Every call that throws leaves it as it was. */
export class Block {
  #exports;
  #scratch;
  #component = 0;
  #start;
  #options;
  #time;

  constructor(model, exports, scratch, start, options) {
    this.model = model;
    /** Warnings of the model since the last start. */
    this.warnings = [];
    this.#exports = exports;
    this.#scratch = scratch;
    this.#options = options;
    const texts = [model.name, model.description.guid].map((text) => this.#text(text));
    this.#component = exports.wasm_instantiate(...texts);
    texts.forEach((place) => exports.free(place));
    if (!this.#component) throw this.#error(3, `there is no memory for another instance of ${model.name}: dispose of some`);
    forgotten.register(this, { free: exports.fmi2FreeInstance, component: this.#component }, this);
    try {
      this.#initialise(start);
    } catch (error) {
      this.dispose();
      throw error;
    }
    this.#start = { ...start };
  }

  /** Time [s]. */
  get time() {
    return this.#time;
  }

  /** Return a value; with the name of an array, those of its elements. */
  get(name) {
    this.#check();
    const found = this.model.find(name);
    const values = found.map((variable) => this.#read(variable));
    return this.model.variables.has(name) ? values[0] : values;
  }

  /** Set a value by name, or several as an object: all of them or none. */
  set(name, value) {
    this.#attempt(() => this.#write(typeof name === "object" ? name : { [name]: value }));
  }

  /** Advance by a time [s]; inputs are held. */
  step(length = this.model.description.experiment.stepSize) {
    this.run({ step: length, steps: 1, outputs: [] });
  }

  /**
   * Make many steps.
   * @param step length of a step [s]
   * @param steps number of steps; follows from arrays of inputs
   * @param inputs for each input an array with a value per row, a function of time, or a number
   * @param outputs names of the recorded variables, by default all outputs
   * @param interpolation of Real inputs between rows: "linear" or "hold"
   * @returns a Float64Array for each name and for `time`: the start and the end of each step
   */
  run({ step = this.model.description.experiment.stepSize, steps, inputs = {}, outputs, interpolation = "linear" } = {}) {
    this.#check();
    if (!["linear", "hold"].includes(interpolation)) {
      throw new RangeError(`the interpolation is "${interpolation}": give "linear" or "hold"`);
    }
    if (!(step > 0 && step < Infinity)) throw new RangeError(`the step is ${step} s: give a positive number of seconds`);
    outputs ??= this.model.description.variables.filter((v) => v.causality === "output").map((v) => v.name);
    const rows = rowsOf(steps, inputs);
    const time = Float64Array.from({ length: rows }, (_, k) => this.#time + k * step);
    const driven = sorted(Object.keys(inputs), (name) => this.#driven(name));
    const columns = driven.map((variable) => column(variable, inputs[variable.name], time));
    const shown = sorted([...new Set(outputs)].filter((name) => name !== "time"), (name) => this.model.find(name));
    const done = this.#compute(step, rows, interpolation, driven, columns, shown);
    this.#time += (rows - 1) * step;
    return { time, ...done };
  }

  /**
   * Return to the start time, with the start values of before and these.
   * @param start start values by name
   */
  reset(start = {}) {
    const together = { ...this.#start, ...start };
    this.#attempt(() => {
      this.#call("fmi2Reset");
      this.#initialise(together);
    });
    this.#start = together;
  }

  /** Return the state as bytes, for `restore` of any block of the same model. */
  save() {
    this.#check();
    return this.#withState((state) => {
      const size = this.#word((place) => this.#call("fmi2SerializedFMUstateSize", state, place));
      const place = this.#exports.malloc(size);
      try {
        this.#call("fmi2SerializeFMUstate", state, place, size);
        return { time: this.#time, bytes: this.#bytes.slice(place, place + size) };
      } finally {
        this.#exports.free(place);
      }
    });
  }

  /** Return to a state from `save`. */
  restore({ time, bytes }) {
    this.#check();
    const place = this.#exports.malloc(bytes.length);
    this.#bytes.set(bytes, place);
    let state = 0;
    try {
      state = this.#word((to) => this.#call("fmi2DeSerializeFMUstate", place, bytes.length, to));
      this.#call("fmi2SetFMUstate", state);
    } finally {
      this.#exports.free(place);
      this.#release(state);
    }
    this.#time = time;
  }

  /** Free the memory of the instance. */
  dispose() {
    if (!this.#component) return;
    forgotten.unregister(this);
    this.#exports.fmi2FreeInstance(this.#component);
    this.#component = 0;
  }

  // ---- life of the instance

  #initialise(start) {
    const { startTime, tolerance } = this.#options;
    const before = this.#time;
    const warnings = this.warnings;
    this.warnings = [];
    try {
      this.#write(start);
      this.#call("fmi2SetupExperiment", tolerance === undefined ? 0 : 1, tolerance ?? 0, startTime, 0, 0);
      this.#call("fmi2EnterInitializationMode");
      this.#call("fmi2ExitInitializationMode");
      this.#time = startTime;
    } catch (error) {
      this.#time = before;
      this.warnings = warnings;
      throw error;
    }
  }

  #check() {
    if (!this.#component) throw new Error(`this block of ${this.model.name} has been disposed of: instantiate another`);
  }

  /** Run a function; if it throws, return to the state of before. */
  #attempt(action) {
    this.#check();
    this.#withState((state) => {
      try {
        action();
      } catch (error) {
        this.#exports.fmi2SetFMUstate(this.#component, state);
        throw error;
      }
    });
  }

  #withState(action) {
    const state = this.#word((place) => {
      this.#view.setUint32(place, 0, true);
      this.#call("fmi2GetFMUstate", place);
    });
    try {
      return action(state);
    } finally {
      this.#release(state);
    }
  }

  #release(state) {
    if (state) this.#word((place) => {
      this.#view.setUint32(place, state, true);
      this.#exports.fmi2FreeFMUstate(this.#component, place);
    });
  }

  // ---- values

  #read(variable) {
    const type = kind(variable), at = this.#scratch;
    this.#view.setUint32(at, variable.reference, true);
    this.#call(`fmi2Get${type}`, at, 1, at + 8);
    if (type === REAL) return this.#view.getFloat64(at + 8, true);
    const whole = this.#view.getInt32(at + 8, true);
    return type === BOOLEAN ? whole !== 0 : whole;
  }

  #write(values) {
    for (const [name, given] of Object.entries(values)) {
      const found = this.model.find(name);
      const each = this.model.variables.has(name) ? [given] : Array.from(given ?? []);
      if (each.length > found.length) {
        throw new RangeError(`${name} has ${found.length} elements, but ${each.length} values were given`);
      }
      each.forEach((value, k) => this.#writeOne(found[k], checked(found[k], value)));
    }
  }

  #writeOne(variable, value) {
    const type = kind(variable), at = this.#scratch;
    this.#view.setUint32(at, variable.reference, true);
    if (type === REAL) this.#view.setFloat64(at + 8, value, true);
    else this.#view.setInt32(at + 8, Number(value), true);
    this.#call(`fmi2Set${type}`, at, 1, at + 8);
  }

  #driven(name) {
    const [variable, ...others] = this.model.find(name);
    if (others.length || variable.causality !== "input") {
      const known = this.model.description.variables.filter((v) => v.causality === "input").map((v) => v.name);
      throw new RangeError(`${name} is not an input of ${this.model.name}; its inputs are ${known.join(", ") || "none"}`);
    }
    return [variable];
  }

  #compute(step, rows, interpolation, driven, columns, shown) {
    const { malloc, free, wasm_run: run } = this.#exports;
    const counts = [driven, shown].flatMap((some) => TYPES.map((type) => some.filter((v) => kind(v) === type).length));
    const references = [...driven, ...shown].map((variable) => variable.reference);
    const words = 4 * (counts.length + references.length), inputs = words + (words % 8);
    const outputs = inputs + 8 * rows * driven.length, size = outputs + 8 * rows * shown.length;
    const place = malloc(size);
    if (!place) throw new RangeError(`there is no memory for ${rows} rows: make several runs`);
    try {
      const { buffer } = this.#exports.memory;
      new Uint32Array(buffer, place, counts.length + references.length).set([...counts, ...references]);
      columns.forEach((values, k) => new Float64Array(buffer, place + inputs + 8 * rows * k, rows).set(values));
      const linear = interpolation === "linear" ? 1 : 0;
      const done = run(this.#component, this.#time, step, rows, linear, place, place + 4 * counts.length, place + inputs, place + outputs);
      const refused = this.#listen();
      if (done < rows) throw refused ?? new RangeError(`there is no memory for ${rows} rows: make several runs`);
      const all = this.#exports.memory.buffer; // the memory may have grown
      return Object.fromEntries(
        shown.map((variable, k) => [variable.name, new Float64Array(all, place + outputs + 8 * rows * k, rows).slice()]),
      );
    } finally {
      free(place);
    }
  }

  // ---- calls of the module

  get #view() {
    return new DataView(this.#exports.memory.buffer);
  }

  get #bytes() {
    return new Uint8Array(this.#exports.memory.buffer);
  }

  #call(name, ...values) {
    const status = this.#exports[name](this.#component, ...values);
    if (status > 0) {
      const refused = this.#listen();
      if (status > WARNING) throw refused ?? new FmuError(`${name} was refused`, STATUS[status]);
    }
  }

  /** Keep the warnings that the module has written, and return the last of its errors. */
  #listen() {
    const start = this.#exports.wasm_messages(), bytes = this.#bytes;
    if (bytes[start] === 0) return undefined;
    const lines = new TextDecoder().decode(bytes.subarray(start, bytes.indexOf(0, start))).split("\n").filter(Boolean);
    bytes[start] = 0;
    const said = lines.map((line) => ({ status: Number(line[0]), message: line.slice(1) }));
    this.warnings.push(...said.filter((each) => each.status === WARNING).map((each) => each.message));
    const refused = said.findLast((each) => each.status > WARNING);
    return refused && new FmuError(refused.message, STATUS[refused.status]);
  }

  #error(status, otherwise) {
    return this.#listen() ?? new FmuError(otherwise, STATUS[status]);
  }

  /** Return the word that a call has written to the scratch memory. */
  #word(call) {
    call(this.#scratch);
    return this.#view.getUint32(this.#scratch, true);
  }

  #text(text) {
    const bytes = new TextEncoder().encode(text);
    const place = this.#exports.malloc(bytes.length + 1);
    this.#bytes.set(bytes, place);
    this.#bytes[place + bytes.length] = 0;
    return place;
  }
}

/** Instances that nobody has disposed of. */
const forgotten = new FinalizationRegistry(({ free, component }) => free(component));

/** Return the variables of several names: Real, then Integer, then Boolean ones. */
function sorted(names, find) {
  const found = names.flatMap(find);
  return TYPES.flatMap((type) => found.filter((variable) => kind(variable) === type));
}

function rowsOf(steps, inputs) {
  const lengths = Object.entries(inputs).filter(([, given]) => typeof given === "object").map(([name, given]) => [name, given.length]);
  const rows = steps === undefined ? lengths[0]?.[1] : steps + 1;
  if (!(Number.isInteger(rows) && rows > 0)) {
    throw new RangeError(`the number of steps is ${steps}: give a whole number, or an array with a value per row for an input`);
  }
  const other = lengths.find(([, length]) => length !== rows);
  if (other) throw new RangeError(`the input ${other[0]} has ${other[1]} values: ${rows - 1} steps need ${rows}`);
  return rows;
}

function column(variable, given, time) {
  if (typeof given === "function") return time.map((t) => Number(checked(variable, given(t))));
  if (typeof given !== "object") return time.map(() => Number(checked(variable, given)));
  return given instanceof Float64Array && variable.type === REAL ? given : Float64Array.from(given, (value) => Number(checked(variable, value)));
}

/** Return a value that has the type of the variable; its limits are the module's business. */
function checked(variable, value) {
  const type = kind(variable);
  const good =
    type === REAL ? typeof value === "number"
    : type === INTEGER ? Number.isInteger(value) && Math.abs(value) < 2 ** 31
    : typeof value === "boolean" || value === 0 || value === 1;
  if (good) return value;
  const wanted = { Real: "a number", Integer: "a whole number", Boolean: "true or false" }[type];
  throw new TypeError(`${variable.name} = ${JSON.stringify(value) ?? typeof value}: give ${wanted}`);
}

/** Return the end of a sentence with the known names that are most similar to a name. */
function suggestion(name, known) {
  const near = known
    .map((other) => [distance(name.toLowerCase(), other.toLowerCase()), other])
    .filter(([apart, other]) => apart <= Math.max(1, Math.min(name.length, other.length) / 2))
    .sort(([one], [two]) => one - two)
    .slice(0, 3);
  return near.length ? `; did you mean ${near.map(([, other]) => other).join(", ")}?` : `; it has ${known.slice(0, 12).join(", ")}`;
}

/** Return the number of characters to insert, remove or replace. */
function distance(one, two) {
  let row = Array.from({ length: two.length + 1 }, (_, k) => k);
  for (let i = 1; i <= one.length; i++) {
    const next = [i];
    for (let k = 1; k <= two.length; k++) {
      next.push(Math.min(row[k] + 1, next[k - 1] + 1, row[k - 1] + (one[i - 1] === two[k - 1] ? 0 : 1)));
    }
    row = next;
  }
  return row[two.length];
}

async function bytesOf(source) {
  if (typeof source !== "string" && !(source instanceof URL)) {
    return source instanceof Response ? source.arrayBuffer() : source;
  }
  if (String(source).startsWith("file:") && globalThis.process?.versions?.node) {
    const { readFile } = await import(/* webpackIgnore: true */ /* @vite-ignore */ "node:fs/promises");
    return readFile(new URL(source));
  }
  const response = await fetch(source);
  if (!response.ok) throw new Error(`${source} cannot be loaded: ${response.status} ${response.statusText}`);
  return response.arrayBuffer();
}
