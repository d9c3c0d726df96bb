/** FMUs of friction-fmus as WebAssembly modules. */

export interface Variable {
  name: string;
  type: "Real" | "Integer" | "Boolean" | "Enumeration";
  reference: number;
  causality: "independent" | "input" | "output" | "local" | "parameter" | "calculatedParameter";
  variability: "continuous" | "discrete" | "tunable" | "fixed" | "constant";
  unit?: string;
  quantity?: string;
  start?: number | boolean;
  min?: number;
  max?: number;
  nominal?: number;
  description?: string;
  /** Names of the values of an enumeration. */
  items?: Record<string, number>;
}

export interface Description {
  name: string;
  description?: string;
  license?: string;
  generationTool?: string;
  guid: string;
  experiment: { startTime: number; stopTime: number; stepSize: number; tolerance?: number };
  variables: Variable[];
  /** Names of the elements of each array. */
  arrays: Record<string, string[]>;
}

export type Source = string | URL | ArrayBuffer | ArrayBufferView | Response | WebAssembly.Module;

/** The FMU has rejected a call; the message is its own. The block is as it was before the call. */
export declare class FmuError extends Error {
  readonly status: "discard" | "error" | "fatal";
}

type AnyValues = Record<string, number | boolean | number[] | boolean[]>;
type Some<Values, Names extends keyof Values> = { [Name in Names]?: Values[Name] };
/** A value per row, a function of time, or one value. */
type Driven<Value> = Value | ArrayLike<Value> | Float64Array | ((time: number) => Value);

export interface RunOptions<Values, Input extends keyof Values, Shown extends keyof Values> {
  /** Length of a step [s], by default the step of the default experiment. */
  step?: number;
  /** Number of steps; follows from arrays of inputs, which have a value more. */
  steps?: number;
  inputs?: { [Name in Input]?: Driven<Values[Name]> };
  /** Variables to record, by default all outputs. */
  outputs?: readonly Shown[];
  /** Real inputs between two rows: "linear" (default), or held. */
  interpolation?: "linear" | "hold";
}

/** A state of a block, for any block of the same model. */
export interface State {
  readonly time: number;
  readonly bytes: Uint8Array;
}

/** A loaded module with the description of its variables. */
export declare class Model<
  Values = AnyValues,
  Input extends keyof Values = keyof Values,
  Output extends keyof Values = keyof Values,
  Settable extends keyof Values = keyof Values,
> {
  static load(source: Source, description: Description): Promise<Model>;
  private constructor();
  readonly name: string;
  readonly description: Description;
  readonly variables: ReadonlyMap<string, Variable>;
  /** Make an instance at its start time. */
  instantiate(
    start?: Some<Values, Settable>,
    options?: { startTime?: number; tolerance?: number },
  ): Block<Values, Input, Output, Settable>;
  /** Return the variables with a name: one, or the elements of an array. */
  find(name: string): Variable[];
}

/** One instance of a model. Every call that throws leaves it as it was. */
export declare class Block<
  Values = AnyValues,
  Input extends keyof Values = keyof Values,
  Output extends keyof Values = keyof Values,
  Settable extends keyof Values = keyof Values,
> {
  private constructor();
  readonly model: Model<Values, Input, Output, Settable>;
  /** Time [s]. */
  readonly time: number;
  /** Warnings of the model since the last start. */
  readonly warnings: readonly string[];
  get<Name extends keyof Values>(name: Name): Values[Name];
  set<Name extends Settable>(name: Name, value: Values[Name]): void;
  /** Set several values: all of them or none. */
  set(values: Some<Values, Settable>): void;
  /** Advance by a time [s]; inputs are held. */
  step(length?: number): void;
  /** Make many steps; returns a row for the start and one for the end of each step. */
  run<Shown extends keyof Values = Output>(
    options?: RunOptions<Values, Input, Shown>,
  ): { [Name in Shown | "time"]: Float64Array };
  /** Return to the start time, with the start values of before and these. */
  reset(start?: Some<Values, Settable>): void;
  save(): State;
  restore(state: State): void;
  /** Free the memory of the instance. */
  dispose(): void;
}
