/* An FMI 2.0 host in C that ends at any status but fmi2OK, as many hosts in the field do. It runs wherever a C compiler
 * does, so the libraries of other platforms can be tried with it, too (win64 under wine).
 *
 * Commands come from standard input, one a line; units count from 0:
 *
 *   unit LIBRARY NAME GUID RESOURCES     loads and instantiates; the rest of the line is the resource location
 *   real UNIT REFERENCE VALUE            sets a value; also integer, boolean, string (the rest of the line)
 *   init                                 initialises all units
 *   wire UNIT REFERENCE UNIT REFERENCE   a real output that feeds a real input in each step
 *   show UNIT REFERENCE                  a real that is printed after each step, by its bits
 *   run STEPS LENGTH                     steps unit after unit
 *   carry UNIT                           stores the state, serialises it, goes on from what was read back
 */
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#ifdef _WIN32
#include <windows.h>
#define OPEN(file) (void *)LoadLibraryA(file)
#define FIND(library, name) GetProcAddress((HMODULE)(library), name)
#else
#include <dlfcn.h>
#define OPEN(file) dlopen(file, RTLD_NOW | RTLD_LOCAL)
#define FIND(library, name) dlsym(library, name)
#endif

enum { UNITS = 4, WIRES = 64, TEXT = 4096 };
typedef struct { void *library, *component; char name[256]; } Unit;
typedef void (*Function)(void);
typedef struct { unsigned unit, reference, to, input; } Wire;
/* The standard's fmi2CallbackFunctions; the logger is variadic. */
typedef struct { void (*logger)(void *, const char *, int, const char *, const char *, ...); void *rest[4]; } Callbacks;

static Unit units[UNITS];
static Wire wires[WIRES], shown[WIRES];
static unsigned count, wired, shows, steps_made;
static double now;

static void logger(void *environment, const char *name, int status, const char *category, const char *format, ...) {
  va_list arguments;
  (void)environment, (void)category;
  va_start(arguments, format);
  fprintf(stderr, "[%d] %s: ", status, name);
  vfprintf(stderr, format, arguments);
  fputc('\n', stderr);
  va_end(arguments);
}
static const Callbacks callbacks = {logger, {0}};

static void fail(const char *what, int status) {
  fprintf(stderr, "host: %s gave status %d at %g s\n", what, status, now);
  exit(1);
}
static Function find(unsigned unit, const char *function) {
  Function found = NULL;
  if (unit < count) {
    /* ISO C has no cast from an object's pointer to a function's. */
    void *symbol = (void *)(uintptr_t)FIND(units[unit].library, function);
    memcpy(&found, &symbol, sizeof found);
  }
  if (!found) fail(function, -1);
  return found;
}
/* Calls `function` of a unit with its component and more arguments; anything but fmi2OK ends the program. */
#define CALL(unit, function, types, ...)                                                    \
  do {                                                                                      \
    int status = ((int (*) types)find(unit, function))(units[unit].component, __VA_ARGS__); \
    if (status) fail(function, status);                                                     \
  } while (0)
#define ASK(unit, function)                                                           \
  do {                                                                                \
    int status = ((int (*)(void *))find(unit, function))(units[unit].component);      \
    if (status) fail(function, status);                                               \
  } while (0)

static double get(unsigned unit, unsigned reference) {
  double value;
  CALL(unit, "fmi2GetReal", (void *, const unsigned *, size_t, double *), &reference, 1, &value);
  return value;
}
static void set(unsigned unit, unsigned reference, double value) {
  CALL(unit, "fmi2SetReal", (void *, const unsigned *, size_t, const double *), &reference, 1, &value);
}
static void set_integer(const char *function, unsigned unit, unsigned reference, int value) {
  CALL(unit, function, (void *, const unsigned *, size_t, const int *), &reference, 1, &value);
}
static void set_string(unsigned unit, unsigned reference, const char *value) {
  CALL(unit, "fmi2SetString", (void *, const unsigned *, size_t, const char *const *), &reference, 1, &value);
}

static void load(const char *library, const char *name, const char *guid, const char *resources) {
  typedef void *(*Instantiate)(const char *, int, const char *, const char *, const Callbacks *, int, int);
  Unit *unit = &units[count++];
  unit->library = OPEN(library);
  if (!unit->library) fail(library, -1);
  strcpy(unit->name, name);
  unit->component = ((Instantiate)find(count - 1, "fmi2Instantiate"))(unit->name, 1, guid, resources, &callbacks, 0, 0);
  if (!unit->component) fail("fmi2Instantiate", -1);
}

static void run(unsigned steps, double length) {
  for (unsigned k = 0; k < steps; k++) {
    now = steps_made * length;
    for (unsigned u = 0; u < count; u++) {
      for (unsigned w = 0; w < wired; w++)
        if (wires[w].to == u) set(u, wires[w].input, get(wires[w].unit, wires[w].reference));
      CALL(u, "fmi2DoStep", (void *, double, double, int), now, length, 1);
    }
    steps_made++;
    for (unsigned s = 0; s < shows; s++) {
      double value = get(shown[s].unit, shown[s].reference);
      uint64_t bits;
      memcpy(&bits, &value, sizeof bits);
      printf("%08lx%08lx%c", (unsigned long)(bits >> 32), (unsigned long)(bits & 0xffffffff), s + 1 < shows ? ' ' : '\n');
    }
  }
}

static void carry(unsigned unit) {
  void *state = NULL, *read = NULL;
  size_t size;
  char *bytes;
  CALL(unit, "fmi2GetFMUstate", (void *, void **), &state);
  CALL(unit, "fmi2SerializedFMUstateSize", (void *, void *, size_t *), state, &size);
  bytes = malloc(size);
  CALL(unit, "fmi2SerializeFMUstate", (void *, void *, char *, size_t), state, bytes, size);
  CALL(unit, "fmi2DeSerializeFMUstate", (void *, const char *, size_t, void **), bytes, size, &read);
  CALL(unit, "fmi2SetFMUstate", (void *, void *), read);
  CALL(unit, "fmi2FreeFMUstate", (void *, void **), &state);
  CALL(unit, "fmi2FreeFMUstate", (void *, void **), &read);
  free(bytes);
}

int main(void) {
  char line[TEXT], a[TEXT], b[TEXT], c[TEXT], rest[TEXT];
  unsigned u, v, w, x;
  int integer;
  double real;
  while (fgets(line, sizeof line, stdin)) {
    line[strcspn(line, "\r\n")] = 0;
    if (count < UNITS && sscanf(line, "unit %s %s %s %[^\n]", a, b, c, rest) == 4) load(a, b, c, rest);
    else if (sscanf(line, "real %u %u %lf", &u, &v, &real) == 3) set(u, v, real);
    else if (sscanf(line, "integer %u %u %d", &u, &v, &integer) == 3) set_integer("fmi2SetInteger", u, v, integer);
    else if (sscanf(line, "boolean %u %u %d", &u, &v, &integer) == 3) set_integer("fmi2SetBoolean", u, v, integer);
    else if (sscanf(line, "string %u %u %[^\n]", &u, &v, rest) == 3) set_string(u, v, rest);
    else if (wired < WIRES && sscanf(line, "wire %u %u %u %u", &u, &v, &w, &x) == 4) wires[wired++] = (Wire){u, v, w, x};
    else if (shows < WIRES && sscanf(line, "show %u %u", &u, &v) == 2) shown[shows++] = (Wire){u, v, 0, 0};
    else if (!strcmp(line, "init"))
      for (u = 0; u < count; u++) {
        CALL(u, "fmi2SetupExperiment", (void *, int, double, double, int, double), 0, 0.0, 0.0, 0, 0.0);
        ASK(u, "fmi2EnterInitializationMode");
        ASK(u, "fmi2ExitInitializationMode");
      }
    else if (sscanf(line, "run %u %lf", &u, &real) == 2) run(u, real);
    else if (sscanf(line, "carry %u", &u) == 1) carry(u);
    else { fprintf(stderr, "host: cannot do: %s\n", line); return 2; }
  }
  for (u = 0; u < count; u++) {
    ASK(u, "fmi2Terminate");
    ((void (*)(void *))find(u, "fmi2FreeInstance"))(units[u].component);
  }
  return 0;
}
