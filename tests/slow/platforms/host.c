/* Drives FMUs through the whole call sequence and writes every number that they return, bit by bit.

   host CASE...   each CASE a text file:
       path of the library, guid, resource URI            a line each
       type reference role amplitude                      a line for each variable: type R I B, role 1 for an input,
                                                          amplitude of what the input is given
   Writes CASE.out: the doubles. Status 1, and a sentence, when a call fails. */

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2FunctionTypes.h"

#ifdef _WIN32
#include <windows.h>
#define LOAD(path) ((void *)LoadLibraryA(path))
#define SYMBOL(library, name) ((void *)GetProcAddress((HMODULE)(library), name))
#else
#include <dlfcn.h>
#define LOAD(path) dlopen(path, RTLD_NOW | RTLD_LOCAL)
#define SYMBOL(library, name) dlsym(library, name)
#endif

#define STEPS 400
#define MOST 4096

static struct {
    fmi2GetTypesPlatformTYPE *types;
    fmi2GetVersionTYPE *version;
    fmi2InstantiateTYPE *instantiate;
    fmi2FreeInstanceTYPE *free_instance;
    fmi2SetupExperimentTYPE *setup;
    fmi2EnterInitializationModeTYPE *enter;
    fmi2ExitInitializationModeTYPE *leave;
    fmi2TerminateTYPE *terminate;
    fmi2ResetTYPE *reset;
    fmi2GetRealTYPE *get_real;
    fmi2GetIntegerTYPE *get_integer;
    fmi2GetBooleanTYPE *get_boolean;
    fmi2SetRealTYPE *set_real;
    fmi2SetBooleanTYPE *set_boolean;
    fmi2SetRealInputDerivativesTYPE *set_slope;
    fmi2GetFMUstateTYPE *get_state;
    fmi2SetFMUstateTYPE *set_state;
    fmi2FreeFMUstateTYPE *free_state;
    fmi2SerializedFMUstateSizeTYPE *size;
    fmi2SerializeFMUstateTYPE *serialize;
    fmi2DeSerializeFMUstateTYPE *deserialize;
    fmi2DoStepTYPE *step;
} fmu;

static struct {
    char library[1024], guid[128], resources[1024];
    char type[MOST];
    fmi2ValueReference reference[MOST];
    int input[MOST];
    double amplitude[MOST];
    int count;
} given;

static uint64_t seed;
static const char *doing;

static double random_share(void) /* -1 to 1, the same on every machine */
{
    seed = seed * 6364136223846793005u + 1442695040888963407u;
    return (double)(int64_t)(seed >> 11) / (double)((int64_t)1 << 52) - 1.0;
}

static void check(fmi2Status status, const char *call)
{
    if (status > fmi2Warning) {
        printf("%s: %s gives the status %d\n", doing, call, (int)status);
        exit(1);
    }
}

static void *find(void *library, const char *name)
{
    void *const symbol = SYMBOL(library, name);
    if (!symbol) {
        printf("%s: the library has no %s\n", doing, name);
        exit(1);
    }
    return symbol;
}

static void load(void)
{
    void *const library = LOAD(given.library);
    if (!library) {
        printf("%s: %s cannot be loaded\n", doing, given.library);
        exit(1);
    }
#define FIND(member, name) memcpy(&fmu.member, &(void *){find(library, name)}, sizeof(void *))
    FIND(types, "fmi2GetTypesPlatform");
    FIND(version, "fmi2GetVersion");
    FIND(instantiate, "fmi2Instantiate");
    FIND(free_instance, "fmi2FreeInstance");
    FIND(setup, "fmi2SetupExperiment");
    FIND(enter, "fmi2EnterInitializationMode");
    FIND(leave, "fmi2ExitInitializationMode");
    FIND(terminate, "fmi2Terminate");
    FIND(reset, "fmi2Reset");
    FIND(get_real, "fmi2GetReal");
    FIND(get_integer, "fmi2GetInteger");
    FIND(get_boolean, "fmi2GetBoolean");
    FIND(set_real, "fmi2SetReal");
    FIND(set_boolean, "fmi2SetBoolean");
    FIND(set_slope, "fmi2SetRealInputDerivatives");
    FIND(get_state, "fmi2GetFMUstate");
    FIND(set_state, "fmi2SetFMUstate");
    FIND(free_state, "fmi2FreeFMUstate");
    FIND(size, "fmi2SerializedFMUstateSize");
    FIND(serialize, "fmi2SerializeFMUstate");
    FIND(deserialize, "fmi2DeSerializeFMUstate");
    FIND(step, "fmi2DoStep");
}

static void read_case(const char *path)
{
    FILE *const file = fopen(path, "r");
    if (!file || fscanf(file, "%1023[^\n] %127[^\n] %1023[^\n]", given.library, given.guid, given.resources) != 3) {
        printf("%s cannot be read\n", path);
        exit(1);
    }
    given.count = 0;
    while (given.count < MOST && fscanf(file, " %c %u %d %lf", &given.type[given.count], &given.reference[given.count],
                                        &given.input[given.count], &given.amplitude[given.count]) == 4)
        given.count++;
    fclose(file);
}

static void put(FILE *file, fmi2Component block)
{
    static double row[MOST]; /* written at once: a call of Wine takes long */
    for (int i = 0; i < given.count; i++) {
        double value = 0.0;
        int whole = 0;
        if (given.type[i] == 'R')
            check(fmu.get_real(block, &given.reference[i], 1, &value), "fmi2GetReal");
        else if (given.type[i] == 'I')
            check(fmu.get_integer(block, &given.reference[i], 1, &whole), "fmi2GetInteger");
        else
            check(fmu.get_boolean(block, &given.reference[i], 1, &whole), "fmi2GetBoolean");
        row[i] = given.type[i] == 'R' ? value : whole;
    }
    fwrite(row, sizeof row[0], (size_t)given.count, file);
}

static void set_inputs(fmi2Component block, double h)
{
    for (int i = 0; i < given.count; i++) {
        const double value = given.amplitude[i] * random_share(), slope = given.amplitude[i] * random_share() / h;
        if (!given.input[i])
            continue;
        if (given.type[i] == 'R') {
            const fmi2Integer order = 1;
            check(fmu.set_real(block, &given.reference[i], 1, &value), "fmi2SetReal");
            check(fmu.set_slope(block, &given.reference[i], 1, &order, &slope), "fmi2SetRealInputDerivatives");
        } else if (given.type[i] == 'B' && random_share() > 0.9) {
            const fmi2Boolean on = random_share() > 0.0;
            check(fmu.set_boolean(block, &given.reference[i], 1, &on), "fmi2SetBoolean");
        }
    }
}

static double run(FILE *file, fmi2Component block, double t, int steps)
{
    for (int k = 0; k < steps; k++) {
        const double h = k % 3 ? 1e-3 : 1e-3 / 3.0;
        set_inputs(block, h);
        check(fmu.step(block, t, h, fmi2True), "fmi2DoStep");
        t += h;
        put(file, block);
    }
    return t;
}

static void initialise(FILE *file, fmi2Component block)
{
    check(fmu.setup(block, fmi2False, 0.0, 0.0, fmi2False, 0.0), "fmi2SetupExperiment");
    check(fmu.enter(block), "fmi2EnterInitializationMode");
    put(file, block);
    check(fmu.leave(block), "fmi2ExitInitializationMode");
    put(file, block);
}

int main(int argc, char **argv)
{
    for (int k = 1; k < argc; k++) {
        char name[1100];
        size_t size;
        doing = argv[k];
        read_case(argv[k]);
        load();
        snprintf(name, sizeof name, "%s.out", argv[k]);
        FILE *const file = fopen(name, "wb");
        const fmi2CallbackFunctions callbacks = {0};
        const bool known = !strcmp(fmu.version(), "2.0") || !strcmp(fmu.version(), "3.0"); /* 3.0: by facade.c */
        if (!file || strcmp(fmu.types(), "default") || !known)
            return printf("%s: no file, or a wrong version or types platform\n", doing), 1;

        fmi2Component first = fmu.instantiate("first", fmi2CoSimulation, given.guid, given.resources, &callbacks, 0, 0);
        fmi2Component second = fmu.instantiate("second", fmi2CoSimulation, given.guid, given.resources, &callbacks, 0, 0);
        if (!first || !second)
            return printf("%s: fmi2Instantiate gives no instance\n", doing), 1;
        seed = 1;
        initialise(file, first);
        double t = run(file, first, 0.0, STEPS);

        /* the state goes to the second instance as bytes, and back in the first one */
        fmi2FMUstate state = NULL, copy = NULL;
        check(fmu.get_state(first, &state), "fmi2GetFMUstate");
        check(fmu.size(first, state, &size), "fmi2SerializedFMUstateSize");
        fmi2Byte *const bytes = malloc(size);
        check(fmu.serialize(first, state, bytes, size), "fmi2SerializeFMUstate");
        check(fmu.deserialize(second, bytes, size, &copy), "fmi2DeSerializeFMUstate");
        check(fmu.set_state(second, copy), "fmi2SetFMUstate");
        free(bytes);
        const uint64_t then = seed;
        run(file, second, t, STEPS / 4);
        seed = then;
        run(file, first, t, STEPS / 4);
        check(fmu.set_state(first, state), "fmi2SetFMUstate");
        seed = then;
        run(file, first, t, STEPS / 4);
        check(fmu.free_state(first, &state), "fmi2FreeFMUstate");
        check(fmu.free_state(second, &copy), "fmi2FreeFMUstate");

        check(fmu.reset(first), "fmi2Reset");
        initialise(file, first);
        run(file, first, 0.0, 10);
        check(fmu.terminate(first), "fmi2Terminate");
        check(fmu.terminate(second), "fmi2Terminate");
        fmu.free_instance(first);
        fmu.free_instance(second);
        if (fclose(file))
            return printf("%s cannot be written\n", name), 1;
    }
    return 0;
}
