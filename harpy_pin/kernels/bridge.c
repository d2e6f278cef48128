/* Calls of compiled kernels from Python: arguments are checked and unpacked in one crossing. It stands behind calls.h.

   What is used of Python is its stable ABI, and of NumPy the beginning of an array object, which it promises to keep.
   Both are declared here, so that a compiler is all that is needed: no headers of Python's. Where objects lie otherwise
   than declared, as in a Python without its global lock, lies_as_declared says so before anything is read. */

/* --- Python's stable ABI --- */
typedef struct object { intptr_t count; void *type; } object;
typedef struct { int slot; void *function; } type_slot;
typedef struct { const char *name; int size; int item; unsigned flags; type_slot *slots; } type_spec;

extern char PyFloat_Type, PyLong_Type, PyBool_Type;
extern object _Py_NoneStruct, _Py_TrueStruct;
object *PyType_FromSpecWithBases(type_spec *, object *);
int PyType_IsSubtype(void *, void *);
intptr_t PyTuple_Size(object *);
object *PyTuple_GetItem(object *, intptr_t);
object *PyTuple_New(intptr_t);
int PyTuple_SetItem(object *, intptr_t, object *);
intptr_t PyDict_Size(object *);
double PyFloat_AsDouble(object *);
object *PyFloat_FromDouble(double);
long long PyLong_AsLongLong(object *);
void *PyLong_AsVoidPtr(object *);
object *PyLong_FromLongLong(long long);
object *PyBool_FromLong(long);
object *PyErr_Occurred(void);
void PyErr_Clear(void);
object *PyObject_GetAttrString(object *, const char *);
object *PyObject_GetAttr(object *, object *);
object *PyObject_Call(object *, object *, object *);
void Py_IncRef(object *);
void Py_DecRef(object *);
void *PyEval_SaveThread(void);
void PyEval_RestoreThread(void *);

enum { TP_CALL = 50, DEFAULT_FLAGS = 1 << 18, BASE_TYPE = 1 << 10 };

/* --- NumPy's array, as far as it is needed --- */
typedef struct {
    object head;
    char *data;
    int axes;
    intptr_t *shape;
    intptr_t *strides;
    object *base;
    object *descr;
    int flags;
} array;

/* The beginning of NumPy's type of elements, alike in its versions 1 and 2. */
typedef struct { object head; object *scalar; char kind, letter, order, flags; int number; } dtype;

enum { VOID = 20 };

enum { CONTIGUOUS = 0x1, ALIGNED = 0x100, WRITEABLE = 0x400 };

/* --- a kernel compiled for one set of types --- */
enum { MOST_AXES = 4, MOST_SYMBOLS = 8 };
enum { ANY = -1, LEAST = 1000, SYMBOL = 1000000, FACTORS = 1000 };
enum { ARRAY, NUMBER, WHOLE, TRUTH, TUPLE };

typedef struct {
    int32_t kind;
    int32_t axes;              /* of an array; items of a tuple */
    int32_t written;           /* whether its memory is written */
    int32_t follow;            /* bits of the axes whose sizes the kernel is told */
    object *type;              /* NumPy's type of its elements */
    int64_t shape[MOST_AXES];  /* a size; ANY; a least one; or a multiple of a size that has a name */
} argument;

typedef struct version {
    void (*entry)(const slot *, slot *);
    struct version *next;
    const char *results;  /* a letter each: r, i, b; after a bracket it is a tuple */
    int32_t count;        /* arguments */
    int32_t release;      /* whether other threads of Python may go on meanwhile */
    argument arguments[];
} version;

/* A kernel, or a chain: what Python derives from it has one slot of its own, the address of what is called. */
typedef struct { object head; object *address; } caller;

static void *called_by(object *self)
{
    object *address = ((caller *)self)->address;
    return address ? PyLong_AsVoidPtr(address) : NULL;
}

static void *array_type, *record_type;

/* Whether objects lie in memory as declared above: a caller with this address, and an array (2, 3) of float64. Its type,
   and that of others that are taken for arrays of records, are kept. */
bool lies_as_declared(object *self, object *address, object *given, void *type, void *data, void *elements, void *record)
{
    const array *x = (const array *)given;
    const dtype *d = elements;
    array_type = type;
    record_type = record;
    return ((caller *)self)->address == address && given->type == type && x->data == data && x->axes == 2
        && x->shape[0] == 2 && x->shape[1] == 3 && x->strides[1] == 8 && x->descr == elements
        && (x->flags & (CONTIGUOUS | ALIGNED | WRITEABLE)) == (CONTIGUOUS | ALIGNED | WRITEABLE)
        && d->kind == 'f' && d->letter == 'd' && d->order == '=' && d->number == 12;
}

/* --- vector registers --- */
#if defined(__x86_64__) && !defined(__AVX__)
#include <cpuid.h>

static bool has_avx;

__attribute__((constructor)) static void ask_the_processor(void)
{
    unsigned a, b, c, d;
    has_avx = __get_cpuid(1, &a, &b, &c, &d) && (c & bit_OSXSAVE) && (c & bit_AVX);
}

__attribute__((target("avx"))) static void clear_registers(void) { __builtin_ia32_vzeroupper(); }

/* AVX code of others may leave the upper halves of vector registers set; each SSE instruction of a kernel then waits. */
static void clear_upper_halves(void) { if (has_avx) clear_registers(); }
#else
static void clear_upper_halves(void) {}
#endif

/* Whether a size is as stated; of a name that is met first it is what the name stands for from now on. */
static bool fits(int64_t stated, int64_t size, int64_t *symbols)
{
    if (stated >= 0) return size == stated;
    if (stated == ANY) return true;
    if (stated > -SYMBOL) return size >= -stated - LEAST;
    const int64_t code = -stated - SYMBOL, factor = code % FACTORS;
    int64_t *symbol = symbols + code / FACTORS;
    if (*symbol < 0) *symbol = size / factor;
    return size == factor * *symbol;
}

/* Whether elements have a type. Those of a record have the object itself; numbers may have another one with the same
   number and order of bytes, as pickles bring. */
static bool same_type(const object *given, const object *type)
{
    const dtype *a = (const dtype *)given, *b = (const dtype *)type;
    return given == type || (a->number == b->number && a->order == b->order && b->number != VOID);
}

/* Unpack one argument; false where it is not what the kernel was compiled for. */
static bool unpack(const argument **wanted, object *given, slot *slots, int *n, int64_t *symbols)
{
    const argument *a = (*wanted)++;
    switch (a->kind) {
    case ARRAY: {
        const array *x = (const array *)given;
        const int flags = CONTIGUOUS | ALIGNED | (a->written ? WRITEABLE : 0);
        if (given->type != array_type && given->type != record_type) return false;
        if (!same_type(x->descr, a->type) || (x->flags & flags) != flags) return false;
        /* A record may come as the array of one element that holds it. */
        if (x->axes != a->axes && (a->axes != 0 || x->axes != 1 || x->shape[0] != 1)) return false;
        slots[(*n)++].pointer = x->data;
        for (int k = 0; k < a->axes; k++) {
            if (!fits(a->shape[k], x->shape[k], symbols)) return false;
            if (a->follow >> k & 1) slots[(*n)++].whole = x->shape[k];
        }
        return true;
    }
    case NUMBER:
        if (given->type != &PyFloat_Type && given->type != &PyLong_Type && !PyType_IsSubtype(given->type, &PyFloat_Type))
            return false;
        slots[*n].number = PyFloat_AsDouble(given);
        if (slots[(*n)++].number == -1.0 && PyErr_Occurred()) { PyErr_Clear(); return false; }
        return true;
    case WHOLE:
        if (given->type != &PyLong_Type) return false;
        slots[*n].whole = PyLong_AsLongLong(given);
        if (slots[*n].whole == -1 && PyErr_Occurred()) { PyErr_Clear(); return false; }
        if (a->shape[0] < -SYMBOL) {
            const int64_t most = symbols[(-a->shape[0] - SYMBOL) / FACTORS];
            if (slots[*n].whole < 0 || slots[*n].whole > most) return false;
        }
        (*n)++;
        return true;
    case TRUTH:
        if (given->type != &PyBool_Type) return false;
        slots[(*n)++].whole = given == &_Py_TrueStruct;
        return true;
    default:
        if (PyTuple_Size(given) != a->axes) { PyErr_Clear(); return false; }
        for (int k = 0; k < a->axes; k++)
            if (!unpack(wanted, PyTuple_GetItem(given, k), slots, n, symbols)) return false;
        return true;
    }
}

static object *pack_one(char letter, slot value)
{
    if (letter == 'r') return PyFloat_FromDouble(value.number);
    if (letter == 'b') return PyBool_FromLong(value.whole != 0);
    return PyLong_FromLongLong(value.whole);
}

static object *pack(const char *letters, const slot *results)
{
    if (!letters[0]) { Py_IncRef(&_Py_NoneStruct); return &_Py_NoneStruct; }
    if (letters[0] != '(') return pack_one(letters[0], results[0]);
    const intptr_t count = (intptr_t)strlen(letters) - 1;
    object *tuple = PyTuple_New(count);
    for (intptr_t k = 0; tuple && k < count; k++) {
        object *item = pack_one(letters[1 + k], results[k]);
        if (!item) { Py_DecRef(tuple); return NULL; }
        PyTuple_SetItem(tuple, k, item);
    }
    return tuple;
}

/* The version that was compiled for such arguments, which are unpacked; NULL without an error where there is none. */
static version *find(object *self, object *arguments, slot *slots)
{
    const intptr_t given = PyTuple_Size(arguments);
    for (version *v = called_by(self); v; v = v->next) {
        if (v->count != given) continue;
        const argument *wanted = v->arguments;
        int64_t symbols[MOST_SYMBOLS] = {-1, -1, -1, -1, -1, -1, -1, -1};
        int n = 0;
        intptr_t k = 0;
        while (k < given && unpack(&wanted, PyTuple_GetItem(arguments, k), slots, &n, symbols)) k++;
        if (k == given) return v;
    }
    return NULL;
}

/* Call it; NULL without an error where there is none. */
static object *attempt(object *self, object *arguments)
{
    slot slots[MOST_SLOTS], results[MOST_RESULTS];
    version *v = find(self, arguments, slots);
    if (!v) return NULL;
    void *state = v->release ? PyEval_SaveThread() : NULL;
    clear_upper_halves();
    v->entry(slots, results);
    if (v->release) PyEval_RestoreThread(state);
    return pack(v->results, results);
}

static object *call(object *self, object *arguments, object *named)
{
    if (!named || PyDict_Size(named) == 0) {
        object *result = attempt(self, arguments);
        if (result || PyErr_Occurred()) return result;
    }
    object *slowly = PyObject_GetAttrString(self, "slowly");
    if (!slowly) return NULL;
    object *result = PyObject_Call(slowly, arguments, named);
    Py_DecRef(slowly);
    return result;
}

/* The result of a call, or None in a tuple of its own where no version fits. */
object *try_call(object *self, object *arguments)
{
    object *result = attempt(self, arguments);
    if (result || PyErr_Occurred()) return result;
    return PyTuple_New(0);
}

/* Bind a kernel to arguments, which the caller keeps; false where no version fits. */
bool bind_call(object *self, object *arguments, bound *out)
{
    const version *v = find(self, arguments, out->slots);
    if (v) out->entry = v->entry;
    return v != NULL;
}

/* --- several kernels in one crossing from Python --- */
typedef struct {
    object *name;               /* attribute of a state */
    double *memory;             /* where calls find it */
    int64_t axes, shape[2];
} sample;

enum { MOST_SAMPLES = 8 };

typedef struct {
    int64_t links, samples;
    object *type;               /* NumPy's type of a sample's elements */
    object *time;               /* name of the time among the attributes */
    double longest;             /* time from which on, before and after zero, there are no targets, s */
    link *first;
    sample sample[MOST_SAMPLES];
} chain;

/* Copy an attribute of a state to where calls find it; false where it is not what they take. */
static bool take(const sample *s, const object *type, object *state)
{
    object *given = PyObject_GetAttr(state, s->name);
    if (!given) { PyErr_Clear(); return false; }
    const array *x = (const array *)given;
    const int flags = CONTIGUOUS | ALIGNED;
    bool fit = given->type == array_type && same_type(x->descr, type);
    fit = fit && x->axes == s->axes && (x->flags & flags) == flags;
    int64_t size = 1;
    for (int64_t k = 0; fit && k < s->axes; k++) {
        fit = x->shape[k] == s->shape[k];
        size *= s->shape[k];
    }
    const double *from = fit ? (const double *)x->data : NULL;
    for (int64_t i = 0; fit && i < size; i++) s->memory[i] = from[i];
    Py_DecRef(given);
    return fit;
}

/* Take a state and make all calls; returns what the last one does, or None where Python has to go on. */
static object *call_chain(object *self, object *arguments, object *named)
{
    const chain *c = called_by(self);
    object *state, *time;
    double t;
    int64_t answer = 0;
    if (!c || named || PyTuple_Size(arguments) != 1) goto python;
    state = PyTuple_GetItem(arguments, 0);
    time = PyObject_GetAttr(state, c->time);
    if (!time) { PyErr_Clear(); goto python; }
    t = time->type == &PyFloat_Type ? PyFloat_AsDouble(time) : c->longest;
    Py_DecRef(time);
    if (!(-c->longest < t && t < c->longest)) goto python;
    for (int64_t k = 0; k < c->samples; k++)
        if (!take(c->sample + k, c->type, state)) goto python;
    clear_upper_halves();
    if (!run_links(c->first, c->first + c->links, t, &answer)) goto python;
    return PyLong_FromLongLong(answer);
python:
    Py_IncRef(&_Py_NoneStruct);
    return &_Py_NoneStruct;
}

/* The type of kernels or of chains, by this name: that of Python, with a call in C. */
object *make_type(object *base, const char *name, bool chains)
{
    type_slot slots[] = {{TP_CALL, NULL}, {0, NULL}};
    type_spec spec = {name, 0, 0, DEFAULT_FLAGS | BASE_TYPE, slots};
    object *(*function)(object *, object *, object *) = chains ? call_chain : call;
    memcpy(&slots[0].function, &function, sizeof function);
    return PyType_FromSpecWithBases(&spec, base);
}
