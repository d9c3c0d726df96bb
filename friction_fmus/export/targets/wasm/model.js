// FMUs of friction-fmus in JavaScript: a `Model` is a loaded WebAssembly module, a `Block` one instance of it. This file
// runs in browsers, workers and Node. model.d.ts describes what is public.

const TYPES = ["Real", "Integer", "Boolean"];
const STATUS = ["ok", "warning", "discard", "error", "fatal"];
const WARNING = 1;
const MOST_ROWS = 2 ** 28; // of 2 GB a column: a module has 4 GB
const typeOf = (variable) => (variable.type === "Enumeration" ? "Integer" : variable.type);

export class FmuError extends Error {
  constructor(message, status) {
    super(message);
    this.name = "FmuError";
    this.status = STATUS[status];
  }
}

// What nobody has disposed of is freed when JavaScript has forgotten it.
const forgotten = new FinalizationRegistry((free) => free());

export class Model {
  #native;

  static async load(source, description) {
    const module = source instanceof WebAssembly.Module ? source : await WebAssembly.compile(await bytesOf(source));
    return new Model(await WebAssembly.instantiate(module, {}), description);
  }

  constructor(instance, description) {
    this.#native = new Native(instance.exports);
    this.description = description;
    this.name = description.name;
    this.variables = new Map(description.variables.map((variable) => [variable.name, variable]));
  }

  instantiate(start = {}, { startTime = 0, tolerance } = {}) {
    return new Block(this, this.#native, start, startTime, tolerance);
  }

  find(name) {
    if (this.variables.has(name)) return [this.variables.get(name)];
    const { arrays } = this.description;
    if (Object.hasOwn(arrays, name)) return arrays[name].map((element) => this.variables.get(element));
    const known = [...this.variables.keys(), ...Object.keys(arrays)];
    throw new RangeError(`${this.name} has no variable "${name}": ${suggestion(String(name), known)}`);
  }

  names(causality) {
    return this.description.variables.filter((variable) => variable.causality === causality).map(({ name }) => name);
  }
}

export class Block {
  #native;
  #component = 0;
  #before = 0; // the state to which a call that fails returns
  #start = {};
  #setup;
  #time;
  #asking = false; // whether an input function of a run is called
  #states = new WeakMap();

  constructor(model, native, start, startTime, tolerance) {
    asNumber("start time", startTime);
    this.model = model;
    this.warnings = [];
    this.#native = native;
    this.#setup = [tolerance === undefined ? 0 : 1, tolerance ?? 0, startTime, 0, 0];
    const texts = [model.name, model.description.guid].map((text) => native.text(text));
    const component = native.exports.wasm_instantiate(...texts);
    texts.forEach((place) => native.exports.free(place));
    if (!component) throw native.refusal(this.warnings) ?? new RangeError(`there is no memory for a block of ${model.name}`);
    this.#component = component;
    forgotten.register(this, () => native.exports.fmi2FreeInstance(component), this);
    try {
      this.#initialise(start);
    } catch (error) {
      this.dispose();
      throw error;
    }
  }

  get time() {
    return this.#time;
  }

  get(name) {
    const values = this.model.find(name).map((variable) => {
      const place = this.#place(variable);
      this.#call(`fmi2Get${typeOf(variable)}`, place, 1, place + 8);
      return this.#native.value(typeOf(variable));
    });
    return this.model.variables.has(name) ? values[0] : values;
  }

  set(name, value) {
    this.#attempt(() => this.#write(typeof name === "object" ? name : { [name]: value }));
  }

  step(length = this.model.description.experiment.stepSize) {
    asNumber("step", length);
    this.#attempt(() => this.#call("fmi2DoStep", this.#time, length, 1));
    this.#time += length;
  }

  run({ step = this.model.description.experiment.stepSize, steps, inputs = {}, outputs, interpolation = "linear" } = {}) {
    if (interpolation !== "linear" && interpolation !== "hold") {
      throw new RangeError(`the interpolation is "${interpolation}": give "linear" or "hold"`);
    }
    asNumber("step", step);
    if (!(step > 0 && step < Infinity)) throw new RangeError(`the step is ${step} s: give a positive number of seconds`);
    this.#check();
    const rows = rowsOf(steps, inputs);
    if (rows > MOST_ROWS) throw tooLong(rows);
    const time = new Float64Array(rows).map((_, k) => this.#time + k * step);
    const driven = byType(Object.keys(inputs).map((name) => this.#input(name)));
    this.#asking = true;
    let columns;
    try {
      columns = driven.map((variable) => columnOf(variable, inputs[variable.name], time));
      const other = columns.findIndex(({ length }) => length !== rows);
      if (other >= 0) {
        const { name } = driven[other], { length } = columns[other];
        throw new RangeError(`the input ${name} has ${length} values: ${rows - 1} steps need ${rows}`);
      }
    } finally {
      this.#asking = false;
    }
    const names = new Set(outputs ?? this.model.names("output"));
    names.delete("time");
    const shown = byType([...names].flatMap((name) => this.model.find(name)));
    const found = this.#rows(step, rows, interpolation === "linear", driven, columns, shown);
    this.#time += (rows - 1) * step;
    return { time, ...Object.fromEntries(shown.map(({ name }, k) => [name, found.subarray(rows * k, rows * (k + 1))])) };
  }

  reset(start = {}) {
    this.#attempt(() => {
      this.#call("fmi2Reset");
      this.#initialise({ ...this.#start, ...start });
    });
  }

  save() {
    const handle = this.#save(0), state = { time: this.#time };
    this.#states.set(state, handle);
    forgotten.register(state, () => this.#free(handle));
    return state;
  }

  restore(state) {
    const handle = this.#states.get(state);
    if (!handle) throw new RangeError("the state is not from this block: give what its save() has returned");
    this.#attempt(() => this.#call("fmi2SetFMUstate", handle));
    this.#time = state.time;
  }

  dispose() {
    if (!this.#component) return;
    this.#check();
    forgotten.unregister(this);
    this.#free(this.#before);
    this.#native.exports.fmi2FreeInstance(this.#component);
    this.#component = 0;
  }

  #initialise(start) {
    const warnings = this.warnings;
    this.warnings = [];
    try {
      this.#write(start);
      this.#call("fmi2SetupExperiment", ...this.#setup);
      this.#call("fmi2EnterInitializationMode");
      this.#call("fmi2ExitInitializationMode");
    } catch (error) {
      this.warnings = warnings;
      throw error;
    }
    this.#start = { ...start };
    this.#time = this.#setup[2];
  }

  #write(values) {
    for (const [name, given] of Object.entries(values)) {
      const found = this.model.find(name);
      if (!this.model.variables.has(name) && typeof given?.[Symbol.iterator] !== "function") {
        throw new TypeError(`${name} is ${shown(given)}: give an array`);
      }
      const each = this.model.variables.has(name) ? [given] : Array.from(given);
      if (each.length > found.length) throw new RangeError(`${name} has ${found.length} elements: ${each.length} are given`);
      each.forEach((value, k) => {
        const number = checked(found[k], value), type = typeOf(found[k]), place = this.#place(found[k]);
        if (type === "Real") this.#native.view.setFloat64(place + 8, number, true);
        else this.#native.view.setInt32(place + 8, number, true);
        this.#call(`fmi2Set${type}`, place, 1, place + 8);
      });
    }
  }

  // Make the steps of a run as one call, and return a column for each of `shown`.
  #rows(step, rows, linear, driven, columns, shown) {
    const { exports } = this.#native;
    const counts = [driven, shown].flatMap((some) => TYPES.map((type) => some.filter((v) => typeOf(v) === type).length));
    const words = [...counts, ...[...driven, ...shown].map(({ reference }) => reference)];
    const inputs = 8 * Math.ceil(words.length / 2), outputs = inputs + 8 * rows * driven.length;
    const place = exports.malloc(outputs + 8 * rows * shown.length);
    try {
      if (place) {
        new Uint32Array(exports.memory.buffer, place, words.length).set(words);
        columns.forEach((column, k) => new Float64Array(exports.memory.buffer, place + inputs + 8 * rows * k, rows).set(column));
        const places = [place, place + 4 * counts.length, place + inputs, place + outputs];
        const done = exports.wasm_run(this.#component, this.#time, step, rows, linear ? 1 : 0, ...places);
        const refusal = this.#native.refusal(this.warnings);
        if (done === rows) return new Float64Array(exports.memory.buffer, place + outputs, rows * shown.length).slice();
        if (refusal) throw refusal;
      }
      throw tooLong(rows);
    } finally {
      exports.free(place);
    }
  }

  // Do something; if it fails, return to the state of before.
  #attempt(action) {
    this.#check();
    this.#before = this.#save(this.#before);
    try {
      action();
    } catch (error) {
      this.#native.exports.fmi2SetFMUstate(this.#component, this.#before);
      throw error;
    }
  }

  // Save the state in memory that exists already, or in new memory if the handle is 0.
  #save(handle) {
    const place = this.#native.scratch;
    this.#native.view.setUint32(place, handle, true);
    this.#call("fmi2GetFMUstate", place);
    return this.#native.view.getUint32(place, true);
  }

  #free(handle) {
    if (!this.#component || !handle) return;
    this.#native.view.setUint32(this.#native.scratch, handle, true);
    this.#native.exports.fmi2FreeFMUstate(this.#component, this.#native.scratch);
  }

  #input(name) {
    const [variable] = this.model.find(name);
    if (variable.causality === "input" && variable.name === name) return variable;
    throw new RangeError(`${name} is not an input of ${this.model.name}: ${listed(this.model.names("input"))}`);
  }

  // Write the reference of a variable, and return where; its value is 8 bytes later.
  #place({ reference }) {
    this.#native.view.setUint32(this.#native.scratch, reference, true);
    return this.#native.scratch;
  }

  // Raise an error if the block cannot be changed now.
  #check() {
    this.#alive();
    if (this.#asking) throw new Error("an input function of run() may read the block, but not change it: use another block");
  }

  #alive() {
    if (!this.#component) throw new Error(`this block of ${this.model.name} has been disposed of: instantiate another`);
  }

  #call(name, ...values) {
    this.#alive();
    const status = this.#native.exports[name](this.#component, ...values);
    if (status === 0) return;
    const refusal = this.#native.refusal(this.warnings);
    if (status > WARNING) throw refusal ?? new FmuError(`${name} was refused`, status);
  }
}

// The functions and the memory of a module, with room for one reference and one value.
class Native {
  #view;

  constructor(exports) {
    this.exports = exports;
    exports._initialize();
    this.scratch = exports.malloc(16);
  }

  get view() {
    if (this.#view?.buffer !== this.exports.memory.buffer) this.#view = new DataView(this.exports.memory.buffer);
    return this.#view;
  }

  value(type) {
    if (type === "Real") return this.view.getFloat64(this.scratch + 8, true);
    const whole = this.view.getInt32(this.scratch + 8, true);
    return type === "Boolean" ? whole !== 0 : whole;
  }

  text(text) {
    const bytes = new TextEncoder().encode(`${text}\0`);
    const place = this.exports.malloc(bytes.length);
    new Uint8Array(this.exports.memory.buffer, place).set(bytes);
    return place;
  }

  // Take the messages of the module: add its warnings to a list, and return the last of the others as an error.
  refusal(warnings) {
    const bytes = new Uint8Array(this.exports.memory.buffer, this.exports.wasm_messages());
    const lines = new TextDecoder().decode(bytes.subarray(0, bytes.indexOf(0))).split("\n").slice(0, -1);
    bytes[0] = 0;
    const said = lines.map((line) => [Number(line[0]), line.slice(1)]);
    warnings.push(...said.filter(([status]) => status === WARNING).map(([, message]) => message));
    const [status, message] = said.filter(([status]) => status > WARNING).at(-1) ?? [];
    return message && new FmuError(message, status);
  }
}

// Real, then Integer, then Boolean variables.
function byType(variables) {
  return TYPES.flatMap((type) => variables.filter((variable) => typeOf(variable) === type));
}

function rowsOf(steps, inputs) {
  const lengths = Object.entries(inputs).filter(([, given]) => given?.length !== undefined && typeof given === "object");
  const rows = steps === undefined ? lengths[0]?.[1].length : steps + 1;
  if (!(Number.isInteger(rows) && rows > 0)) {
    throw new RangeError(`the number of steps is ${steps}: give a whole number, or an input as an array with a value more`);
  }
  return rows;
}

function columnOf(variable, given, time) {
  if (given instanceof Float64Array && typeOf(variable) === "Real") return given;
  if (typeof given === "function") return time.map((t) => checked(variable, given(t)));
  if (typeof given !== "object" || given === null) return time.fill.call(new Float64Array(time.length), checked(variable, given));
  return Float64Array.from(given, (value) => checked(variable, value));
}

function asNumber(what, seconds) {
  if (typeof seconds === "number") return;
  throw new TypeError(`the ${what} is ${shown(seconds)}: give a number of seconds`);
}

const tooLong = (rows) => new RangeError(`there is no memory for ${rows} rows: make several runs`);

const shown = (value) => (typeof value === "string" ? JSON.stringify(value) : String(value));

// Return the number of a value that has the type of the variable; the module checks its limits.
function checked(variable, value) {
  const type = typeOf(variable);
  if (type === "Real" && typeof value === "number") return value;
  if (type === "Integer" && value === (value | 0)) return value;
  if (type === "Boolean" && (typeof value === "boolean" || value === 0 || value === 1)) return Number(value);
  const wanted = { Real: "a number", Integer: "a whole number", Boolean: "true or false" }[type];
  throw new TypeError(`${variable.name} is ${shown(value)}: give ${wanted}`);
}

const listed = (names) => `known are ${names.slice(0, 12).join(", ") || "none"}${names.length > 12 ? ", ..." : ""}`;

// Return the end of a sentence with the known names that are most similar to a name.
function suggestion(name, known) {
  const near = known
    .map((other) => [distance(name.toLowerCase(), other.toLowerCase()), other])
    .filter(([apart, other]) => apart < Math.max(name.length, other.length) / 2)
    .sort(([one], [two]) => one - two);
  return near.length ? `did you mean ${near.slice(0, 3).map(([, other]) => other).join(", ")}?` : listed(known);
}

// Return how many characters one text has to gain, lose or change to become the other.
function distance(one, two) {
  let row = Array.from({ length: two.length + 1 }, (_, k) => k);
  for (const [i, letter] of [...one].entries()) {
    const above = row;
    row = [i + 1];
    for (let k = 0; k < two.length; k++) row.push(Math.min(above[k + 1] + 1, row[k] + 1, above[k] + (letter !== two[k])));
  }
  return row[two.length];
}

async function bytesOf(source) {
  if (source instanceof Response) return source.arrayBuffer();
  if (typeof source !== "string" && !(source instanceof URL)) return source;
  if (String(source).startsWith("file:") && globalThis.process?.versions?.node) {
    const { readFile } = await import(/* webpackIgnore: true */ /* @vite-ignore */ "node:fs/promises");
    return readFile(new URL(source));
  }
  const response = await fetch(source);
  if (!response.ok) throw new Error(`${source} cannot be loaded: ${response.status} ${response.statusText}`);
  return response.arrayBuffer();
}
