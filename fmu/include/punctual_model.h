/*
 * punctual_model.h: a plant and barriers as compiled code, for Punctual.
 *
 * A plug-in is a shared library that exports one function, punctual_model, which gives the description of a model
 *
 *     dx/dt = f(x) + g(x) u,    h_0(t, x), h_1(t, x), ...
 *
 * with nx states x, nu inputs u and any number of barriers h. Copy this file; it needs a C99 or C++11 compiler, and
 * nothing else. docs/plugin.md goes through an example.
 *
 *     cc -std=c99 -O2 -shared -fPIC -o libcar.so car.c           Linux
 *     cc -std=c99 -O2 -dynamiclib -o libcar.dylib car.c          macOS
 *     cl /O2 /LD car.c                                           Windows: car.dll
 *
 * NUMBERS. The functions of a model do not get plain doubles but names of numbers (punctual_number), and ask for
 * operations on them: behind each name are the Taylor coefficients of that number along a solution, with their
 * derivatives along inputs and directions, and the operations below do what is right on all of them. So f, g and h are
 * written once, as on paper, and the derivatives of h, of any order, are exact. A name is valid within the
 * call in which it was given.
 *
 * RULES. What the functions write may depend on their arguments only: no memory of earlier calls, no clock, no random
 * numbers, since steps are repeated and taken back. At the same values they must ask for the same operations in the same
 * order. They may be called by several threads at the same time, each with a calculator of its own, which is for the thread that
 * called; they must not allocate memory or wait where steps are to be made in real time, and must not throw or longjmp out.
 *
 * BRANCHES AND TABLES. punctual_value gives the plain value of a number, to branch on; what is computed from plain
 * values has no derivatives. For a function that is not below, such as one that is interpolated in a table, look its
 * value and derivatives up at punctual_value and hand them to punctual_function. All must have as many continuous
 * derivatives as the relative degree of the barrier, and one more.
 *
 * FAILURES. What is not defined (the square root of a negative number) is not a number, and shows as status "singular"
 * of the filter, or as an error of the step of a plant. A function may return a number of its own that is none
 * (punctual_constant(c, NAN)) to say that the model does not hold there.
 *
 * TRIAL. When a model is loaded, its functions are run at sample states within the ranges of the states, and refused
 * if they use numbers that they were not given, ask for other operations when they are called again, for more than
 * 4096 in all (f, g and a barrier), or give first derivatives that differences of the values contradict.
 */
#ifndef PUNCTUAL_MODEL_H
#define PUNCTUAL_MODEL_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* The version of this interface; a plug-in of another one is refused. */
#define PUNCTUAL_ABI 1u

/* Before the definition of punctual_model. */
#if defined(_WIN32)
#define PUNCTUAL_EXPORT __declspec(dllexport)
#else
#define PUNCTUAL_EXPORT __attribute__((visibility("default")))
#endif

/* A number that is computed with. */
typedef struct punctual_number {
    uint32_t id;
} punctual_number;

/* What computes; given to the functions of a model, and valid during the call. */
typedef struct punctual_calculator {
    void *host;
    /* Use the functions below. `operation` is one of PUNCTUAL_ADD and so on; an id of PUNCTUAL_LITERAL stands for
     * `literal`. */
    punctual_number (*apply)(void *host, uint32_t operation, punctual_number a, punctual_number b, double literal);
    double (*value)(void *host, punctual_number a);
} punctual_calculator;

/* A state, input, parameter or barrier. Texts are UTF-8 and live as long as the library. */
typedef struct punctual_variable {
    const char *name;        /* a C identifier of at most 64 characters, unique in the model */
    const char *unit;        /* such as "m/s2" or "kg.m2/s"; NULL: "1". Of kg, m, s, A, K, mol, cd, rad, Hz, N, Pa, J, W, C, V */
    const char *description; /* for a human; NULL: none */
    double minimum, maximum; /* the range; both 0: none, and an end that is infinite is none. Of a state where the
                                model is meant to be used, of an input its default bounds. Not for barriers */
    double start;            /* of a parameter: its default, within the range. Else not used */
} punctual_variable;

/* A model. */
typedef struct punctual_model_description {
    uint32_t abi;  /* PUNCTUAL_ABI */
    uint32_t size; /* sizeof(punctual_model_description) */
    uint32_t states;     /* nx: 1 to 32 */
    uint32_t inputs;     /* nu: 1 to 12 */
    uint32_t parameters; /* 0 to 256 */
    uint32_t barriers;   /* 0 to 64 */
    const punctual_variable *state;     /* as many as there are */
    const punctual_variable *input;
    const punctual_variable *parameter; /* NULL where there are none */
    const punctual_variable *barrier;   /* NULL where there are none */
    /* Called for every instance before the other functions: more than once, and while those of another instance run. What
     * is read or computed once goes here, once (call_once, a flag under a lock). Returns NULL, or why the model cannot be used. NULL: nothing is to be done. */
    const char *(*initialize)(void);
    /* Writes f(x) to f[0 .. nx-1], and g(x) to g[i + j*nx] for state i and input j. Both come as zeros: write only what is
     * not. `parameters` has the values of the parameters in their order. */
    void (*plant)(const punctual_calculator *c, const double *parameters, const punctual_number *x, punctual_number *f,
                  punctual_number *g);
    /* h_index(t, x), with the time t of the simulation in s. NULL where there are no barriers. */
    punctual_number (*barrier_value)(const punctual_calculator *c, uint32_t index, const double *parameters,
                                     punctual_number t, const punctual_number *x);
} punctual_model_description;

/* The function to export: what it returns lives as long as the library. */
PUNCTUAL_EXPORT const punctual_model_description *punctual_model(void);

/* Operations. The functions after them are all that a model needs. */
enum {
    PUNCTUAL_CONSTANT,
    PUNCTUAL_ADD,
    PUNCTUAL_SUBTRACT,
    PUNCTUAL_MULTIPLY,
    PUNCTUAL_DIVIDE,
    PUNCTUAL_POWER,
    PUNCTUAL_NEGATE,
    PUNCTUAL_SQRT,
    PUNCTUAL_EXP,
    PUNCTUAL_LN,
    PUNCTUAL_SIN,
    PUNCTUAL_COS,
    PUNCTUAL_TAN,
    PUNCTUAL_ATAN,
    PUNCTUAL_ATAN2,
    PUNCTUAL_ABS,
    PUNCTUAL_TANH,
    PUNCTUAL_MIN,
    PUNCTUAL_MAX
};
#define PUNCTUAL_LITERAL UINT32_MAX

/* name(c, a) */
#define PUNCTUAL_OF_ONE(name, operation)                                                                  \
    static inline punctual_number name(const punctual_calculator *c, punctual_number a) {                 \
        return c->apply(c->host, operation, a, a, 0.0);                                                   \
    }
/* name(c, a, b) */
#define PUNCTUAL_OF_TWO(name, operation)                                                                  \
    static inline punctual_number name(const punctual_calculator *c, punctual_number a, punctual_number b) { \
        return c->apply(c->host, operation, a, b, 0.0);                                                   \
    }
/* name(c, a, b), b a plain number that does not depend on x or t */
#define PUNCTUAL_OF_NUMBER(name, operation)                                                               \
    static inline punctual_number name(const punctual_calculator *c, punctual_number a, double b) {       \
        punctual_number literal;                                                                          \
        literal.id = PUNCTUAL_LITERAL;                                                                    \
        return c->apply(c->host, operation, a, literal, b);                                               \
    }

PUNCTUAL_OF_TWO(punctual_add, PUNCTUAL_ADD)
PUNCTUAL_OF_TWO(punctual_subtract, PUNCTUAL_SUBTRACT)
PUNCTUAL_OF_TWO(punctual_multiply, PUNCTUAL_MULTIPLY)
PUNCTUAL_OF_TWO(punctual_divide, PUNCTUAL_DIVIDE)
PUNCTUAL_OF_TWO(punctual_atan2, PUNCTUAL_ATAN2) /* the angle of (b, a), as atan2(a, b) of C */
/* Where these and punctual_abs have a kink, the derivatives are those of one side. */
PUNCTUAL_OF_TWO(punctual_min, PUNCTUAL_MIN)
PUNCTUAL_OF_TWO(punctual_max, PUNCTUAL_MAX)
PUNCTUAL_OF_NUMBER(punctual_offset, PUNCTUAL_ADD)      /* a + b */
PUNCTUAL_OF_NUMBER(punctual_scale, PUNCTUAL_MULTIPLY)  /* a b */
PUNCTUAL_OF_NUMBER(punctual_power, PUNCTUAL_POWER)     /* a to the power of b; whole b for any a */
PUNCTUAL_OF_ONE(punctual_negate, PUNCTUAL_NEGATE)
PUNCTUAL_OF_ONE(punctual_sqrt, PUNCTUAL_SQRT)
PUNCTUAL_OF_ONE(punctual_exp, PUNCTUAL_EXP)
PUNCTUAL_OF_ONE(punctual_ln, PUNCTUAL_LN)
PUNCTUAL_OF_ONE(punctual_sin, PUNCTUAL_SIN) /* angles in rad */
PUNCTUAL_OF_ONE(punctual_cos, PUNCTUAL_COS)
PUNCTUAL_OF_ONE(punctual_tan, PUNCTUAL_TAN)
PUNCTUAL_OF_ONE(punctual_atan, PUNCTUAL_ATAN)
PUNCTUAL_OF_ONE(punctual_tanh, PUNCTUAL_TANH)
PUNCTUAL_OF_ONE(punctual_abs, PUNCTUAL_ABS)

/* A number that does not depend on x or t. */
static inline punctual_number punctual_constant(const punctual_calculator *c, double value) {
    punctual_number literal;
    literal.id = PUNCTUAL_LITERAL;
    return c->apply(c->host, PUNCTUAL_CONSTANT, literal, literal, value);
}

/* a - b, a a plain number. */
static inline punctual_number punctual_from(const punctual_calculator *c, double a, punctual_number b) {
    punctual_number literal;
    literal.id = PUNCTUAL_LITERAL;
    return c->apply(c->host, PUNCTUAL_SUBTRACT, literal, b, a);
}

/* The plain value of a. */
static inline double punctual_value(const punctual_calculator *c, punctual_number a) {
    return c->value(c->host, a);
}

/*
 * A function of one number that is given by its value and derivatives at punctual_value(c, a): derivatives[0] is the
 * value, derivatives[k] the derivative of order k, `count` of them. A barrier of relative degree n needs the orders up
 * to n + 2, that is a count of n + 3, and plans those up to 9; those that are not given count as 0. Between the
 * instants at which a plan looks, nothing is known of such a function: narrow dips of it are not seen.
 */
static inline punctual_number punctual_function(const punctual_calculator *c, punctual_number a,
                                                const double *derivatives, size_t count) {
    punctual_number away, sum;
    double factorial = 1.0;
    size_t k;
    if (count == 0) {
        return punctual_constant(c, 0.0);
    }
    for (k = 2; k < count; k++) {
        factorial *= (double)k;
    }
    /* Its value is 0, its derivatives are those of a: powers above the last order vanish. */
    away = punctual_offset(c, a, -punctual_value(c, a));
    sum = punctual_constant(c, derivatives[count - 1] / factorial);
    for (k = count - 1; k > 0; k--) {
        factorial /= (double)k;
        sum = punctual_offset(c, punctual_multiply(c, sum, away), derivatives[k - 1] / factorial);
    }
    return sum;
}

#ifdef __cplusplus
} /* extern "C" */

namespace punctual {
/* The same as operators: Number a = {c, x[0]}; f[0] = a * sin(a) + 2.0; */
struct Number {
    const punctual_calculator *c;
    punctual_number number;
    operator punctual_number() const { return number; }
};
inline Number operator+(Number a, Number b) { return {a.c, punctual_add(a.c, a.number, b.number)}; }
inline Number operator-(Number a, Number b) { return {a.c, punctual_subtract(a.c, a.number, b.number)}; }
inline Number operator*(Number a, Number b) { return {a.c, punctual_multiply(a.c, a.number, b.number)}; }
inline Number operator/(Number a, Number b) { return {a.c, punctual_divide(a.c, a.number, b.number)}; }
inline Number operator-(Number a) { return {a.c, punctual_negate(a.c, a.number)}; }
inline Number operator+(Number a, double b) { return {a.c, punctual_offset(a.c, a.number, b)}; }
inline Number operator+(double a, Number b) { return b + a; }
inline Number operator-(Number a, double b) { return {a.c, punctual_offset(a.c, a.number, -b)}; }
inline Number operator-(double a, Number b) { return {b.c, punctual_from(b.c, a, b.number)}; }
inline Number operator*(Number a, double b) { return {a.c, punctual_scale(a.c, a.number, b)}; }
inline Number operator*(double a, Number b) { return b * a; }
inline Number operator/(Number a, double b) { return a / Number{a.c, punctual_constant(a.c, b)}; }
inline Number operator/(double a, Number b) { return Number{b.c, punctual_constant(b.c, a)} / b; }
inline Number pow(Number a, double b) { return {a.c, punctual_power(a.c, a.number, b)}; }
inline Number sqrt(Number a) { return {a.c, punctual_sqrt(a.c, a.number)}; }
inline Number exp(Number a) { return {a.c, punctual_exp(a.c, a.number)}; }
inline Number log(Number a) { return {a.c, punctual_ln(a.c, a.number)}; }
inline Number sin(Number a) { return {a.c, punctual_sin(a.c, a.number)}; }
inline Number cos(Number a) { return {a.c, punctual_cos(a.c, a.number)}; }
inline Number tan(Number a) { return {a.c, punctual_tan(a.c, a.number)}; }
inline Number atan(Number a) { return {a.c, punctual_atan(a.c, a.number)}; }
inline Number atan2(Number a, Number b) { return {a.c, punctual_atan2(a.c, a.number, b.number)}; }
inline Number tanh(Number a) { return {a.c, punctual_tanh(a.c, a.number)}; }
inline Number abs(Number a) { return {a.c, punctual_abs(a.c, a.number)}; }
inline Number min(Number a, Number b) { return {a.c, punctual_min(a.c, a.number, b.number)}; }
inline Number max(Number a, Number b) { return {a.c, punctual_max(a.c, a.number, b.number)}; }
inline double value(Number a) { return punctual_value(a.c, a.number); }
} /* namespace punctual */
#endif

#endif
