/* friction-fmus as a classic script: `frictionFmus.load(name)` returns the promise of a model that a script with
   `frictionFmus.register(...)` carries. */
globalThis.frictionFmus ??= (() => {
  "use strict";

/* model.js */

  const registered = new Map();

  /** Add a model: its description, and its module compressed with gzip in base64. */
  function register(description, data) {
    registered.set(description.name, { description, data });
  }

  /** Return the names of the models that are registered. */
  function names() {
    return [...registered.keys()];
  }

  async function load(name) {
    const found = registered.get(name);
    if (!found) throw new RangeError(`there is no model "${name}"${suggestion(String(name), names())}`);
    found.model ??= decoded(found);
    return found.model;
  }

  async function decoded({ description, data }) {
    const bytes = Uint8Array.from(atob(data), (character) => character.charCodeAt(0));
    const unzipped = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    return Model.load(new Response(unzipped), description);
  }

  return { Model, Block, FmuError, register, names, load };
})();
