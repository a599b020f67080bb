/* Punctual: fixed-time safety filters, without an operating system.

   docs/embedded.md of the project has a loop to begin with. `punctual build car.toml --embedded car.bin` writes the file of a
   filter. Rules: memory comes from the caller, aligned to 8 bytes; only punctual_load allocates, and only in that memory; nothing
   is global but a lock while a filter is loaded. One filter is used by one context at a time; two filters side by side do not
   know of each other. This file is made by cbindgen. */

#ifndef PUNCTUAL_H
#define PUNCTUAL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* What a step did; numbered as in the FMU. */
enum punctual_status {
  /* u_ref satisfies every constraint and is passed through */
  PUNCTUAL_UNCHANGED = 0,
  /* u is the safe input nearest to u_ref */
  PUNCTUAL_FILTERED = 1,
  /* not possible within the input bounds: least violation */
  PUNCTUAL_INFEASIBLE = 2,
  /* the barrier cannot be influenced at this state */
  PUNCTUAL_NO_AUTHORITY = 3,
  /* an input is not a number or infinite: u nearest 0 */
  PUNCTUAL_INVALID_INPUT = 4,
  /* the model is not finite at this state: u nearest 0 */
  PUNCTUAL_SINGULAR = 5,
  /* the constraint would be wrong: u nearest 0 */
  PUNCTUAL_WRONG_RELATIVE_DEGREE = 6,
  /* no convergence: u_ref within its bounds */
  PUNCTUAL_SOLVER_FAILED = 7,
  /* a plan decides, and keeps every promise */
  PUNCTUAL_BACKUP = 8,
  /* not armed yet: nothing is promised, u_ref within its bounds */
  PUNCTUAL_NOT_ARMED = 9,
};

/* Where the promise of a barrier is; numbered as in the FMU. */
enum punctual_phase {
  /* not begun: no step with valid inputs yet, or not armed */
  PUNCTUAL_WAITING = 0,
  /* approaching, before the deadline */
  PUNCTUAL_APPROACH = 1,
  /* the deadline passed outside the set; the approach continues */
  PUNCTUAL_LATE = 2,
  /* inside, and kept there */
  PUNCTUAL_STAY = 3,
  /* outside again; pulled back without a deadline */
  PUNCTUAL_LEFT = 4,
  /* released: nothing is required any more */
  PUNCTUAL_RELEASED = 5,
};

/* Whether the plan of the file is followed. */
enum punctual_plan {
  /* no step was taken, or there is no plan */
  PUNCTUAL_PLAN_NOT_BEGUN = 0,
  /* the plan decides: its promises are kept, whatever u_ref comes */
  PUNCTUAL_PLAN_KEPT = 1,
  /* the plan has ended: the rows decide */
  PUNCTUAL_PLAN_ENDED = 2,
  /* the first state is outside the starts of the plan: the rows decide */
  PUNCTUAL_PLAN_OUT_OF_START = 3,
  /* the state is where the declared plant cannot be: the rows decide */
  PUNCTUAL_PLAN_OUT_OF_TUBE = 4,
  /* no step came when a hold of the plan began: the rows decide */
  PUNCTUAL_PLAN_LATE = 5,
};


// What a function returns: 0, or why it did nothing.
typedef enum punctual_result {
  // Done.
  PUNCTUAL_RESULT_OK = 0,
  // A pointer is null, or memory is not aligned to 8 bytes.
  PUNCTUAL_RESULT_POINTER = 1,
  // A length is not that of the filter; a time is negative or no number; there is no such barrier.
  PUNCTUAL_RESULT_ARGUMENT = 2,
  // The memory is less than `punctual_size`; the buffer is less than `punctual_saved_size`.
  PUNCTUAL_RESULT_MEMORY = 3,
  // The file is no filter of this version: write it again with `punctual build --embedded`.
  PUNCTUAL_RESULT_FORMAT = 4,
  // The file or the saved state is damaged.
  PUNCTUAL_RESULT_DAMAGED = 5,
  // The filter needs more inputs, a higher relative degree or more rows than this library has room for: build the library
  // without the feature `small`.
  PUNCTUAL_RESULT_ROOM = 6,
  // The file has a number out of its range.
  PUNCTUAL_RESULT_RANGE = 7,
  // Another filter is being loaded at this moment, by an interrupt or a thread: load again.
  PUNCTUAL_RESULT_BUSY = 8,
} punctual_result;

// A filter. It lives in the memory that `punctual_load` was given, its plan in the file.
typedef struct punctual_filter punctual_filter;

// What a step did.
typedef struct punctual_report {
  // The status: `PUNCTUAL_UNCHANGED` and so on, numbered as in the FMU.
  int32_t status;
  // Rounds of the active-set method.
  uint32_t iterations;
  // The period in s over which the rows hold, 0 if at the sample alone.
  double period;
  // Whether a plan is followed, and why not: `PUNCTUAL_PLAN_KEPT` and so on.
  int32_t plan;
  // The time in s until which the promises of the plan are kept, whatever `u_ref` comes; 0 if none is followed.
  double guaranteed_until;
} punctual_report;

// What a step found of one barrier.
typedef struct punctual_barrier_report {
  // h, in its unit; the set is h >= 0.
  double h;
  // Time in s until the deadline; infinite if there is none.
  double time_left;
  // By how much its row holds; negative where it does not.
  double slack;
  // Time in s at which h >= 0 was reached, NaN before.
  double arrival_time;
  // The phase: `PUNCTUAL_WAITING` and so on, numbered as in the FMU.
  int32_t phase;
  // Steps in a row that did not meet its row.
  uint32_t unmet_steps;
  // Whether the theorem behind its promise applies from this step on.
  bool on_course;
  // Whether the input bounds rule out that its deadline is met.
  bool deadline_unreachable;
  // Whether other barriers keep it from its goal.
  bool deadlocked;
  // Whether the plan keeps its promise, whatever `u_ref` comes.
  bool guaranteed;
} punctual_barrier_report;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// The number of bytes that a filter needs, in `*size`.
enum punctual_result punctual_size(const void *file, size_t file_size, size_t *size);

// Makes the filter of `file` in `memory`, which it keeps. If the file has a plan, it is used where it is, in flash for example, and
// has to stay as it is; otherwise it may go. The only function that allocates, and only in `memory`.
enum punctual_result punctual_load(void *memory,
                                   size_t memory_size,
                                   const void *file,
                                   size_t file_size,
                                   struct punctual_filter **filter);

// The numbers of states, inputs and barriers; 0 for null.
enum punctual_result punctual_dimensions(const struct punctual_filter *filter,
                                         size_t *states,
                                         size_t *inputs,
                                         size_t *barriers);

// The time in s, > 0, for which the input of the next step will be held, if the timer knows it; 0 if not.
enum punctual_result punctual_expect_hold(struct punctual_filter *filter, double seconds);

// Writes to `u` the safe input nearest to `u_ref` at time `t` (s) and state `x`: finite and within its bounds, whatever
// `x` and `u_ref` are. Does not allocate.
enum punctual_result punctual_step(struct punctual_filter *filter,
                                   double t,
                                   const double *x,
                                   size_t states,
                                   const double *u_ref,
                                   double *u,
                                   size_t inputs,
                                   struct punctual_report *report);

// What the last step found of barrier number `index`, from 0 in the order of the file.
enum punctual_result punctual_barrier(const struct punctual_filter *filter,
                                      size_t index,
                                      struct punctual_barrier_report *barrier);

// Forgets what was promised: the next step starts every deadline again, and the plan.
enum punctual_result punctual_rearm(struct punctual_filter *filter);

// The most bytes that `punctual_save` writes; 0 for null.
size_t punctual_saved_size(const struct punctual_filter *filter);

// Writes what the filter remembers to `buffer`, and the number of bytes to `*written`.
enum punctual_result punctual_save(const struct punctual_filter *filter,
                                   void *buffer,
                                   size_t size,
                                   size_t *written);

// Continues from what `punctual_save` wrote, as if there had been no break. On another filter of the same file too.
enum punctual_result punctual_restore(struct punctual_filter *filter,
                                      const void *buffer,
                                      size_t size);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* PUNCTUAL_H */
