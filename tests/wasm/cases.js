// Runs cases with the models that classic scripts have registered: the rows of each, or the message of an error.
globalThis.runCases = async (cases) => {
  const results = [];
  for (const { model, start, options } of cases) {
    const block = (await frictionFmus.load(model)).instantiate(start);
    try {
      const found = block.run(options);
      results.push(options.outputs.map((name) => Array.from(found[name])));
    } catch (error) {
      results.push(error.message);
    }
    block.dispose();
  }
  return results;
};
