/* palpate_controllers.h - the force controllers of Palpate for C and whatever can call C (Unity,
 * Unreal, Rust, Python's ctypes). Link libpalpate_controllers_c; flags: pkg-config
 * palpate_controllers.
 *
 * SI units, one right-handed frame (the device's). Forces are on the hand. Structs filled with
 * zeros are valid. No function throws, none but create, set and destroy allocates; a handle is used
 * by one thread at a time. The layout of the structs changes only with the minor version while the
 * major one is 0, then only with the major one. */
#ifndef PALPATE_CONTROLLERS_H
#define PALPATE_CONTROLLERS_H

#include <stddef.h>

#if defined(_WIN32)
#define PALPATE_API
#else
#define PALPATE_API __attribute__((visibility("default")))
#endif

#ifdef __cplusplus
extern "C" {
#endif

typedef struct palpate_controller palpate_controller; /* one controller and its settings */

typedef enum palpate_status {
  PALPATE_OK = 0,
  PALPATE_NULL_POINTER = 1,
  PALPATE_UNKNOWN_NAME = 2,
  PALPATE_OUT_OF_RANGE = 3, /* of a setting; palpate_controller_error says the rule */
  PALPATE_NOT_FINITE = 4,   /* in an input: the answer is no force */
  PALPATE_NO_MEMORY = 5
} palpate_status;

/* One force and what the hand did while it acted. */
typedef struct palpate_stretch {
  double duration_s; /* >= 0, measured */
  double force_on_hand_newton[3];
  double hand_position_at_end_m[3]; /* measured */
  int is_end_unknown;               /* not 0: the position at the end was not read */
} palpate_stretch;

/* The tissue where the tool is not; for virtual coupling and Lyapunov. No allocation, no blocking.
 */
typedef void (*palpate_tissue)(void* user, const double hand_position_m[3],
                               const double hand_velocity_m_per_s[3],
                               double force_on_hand_newton[3], double* stored_energy_joule);

/* One control step. */
typedef struct palpate_input {
  double hand_position_m[3]; /* measured now */
  double hand_velocity_m_per_s[3];
  const palpate_stretch* applied;        /* what acted since the previous step, in time order */
  size_t applied_count;                  /* 0 in the first step */
  int has_gap;                           /* not 0: it is not known what acted */
  double acting_force_on_hand_newton[3]; /* acts now, until it is replaced */
  double acting_lease_s;                 /* ends by itself after this time; 0: not known */
  double requested_force_on_hand_newton[3];
  int is_request_held;        /* not 0: the same evaluation of the tissue as in the last step */
  double stored_energy_joule; /* elastic energy that the tissue may give back; 0: not known */
  double evaluated_at_m[3];   /* where the hand was for the tissue at the request; two_port,
                                 passivity_control_reference */
  double surface_normal[3];   /* of the contact, out of the tissue, or zeros; memory_based */
  palpate_tissue tissue;      /* or NULL */
  void* tissue_user;
} palpate_input;

typedef struct palpate_output {
  double force_on_hand_newton[3];
  double f_max_newton[3];     /* bound per axis; NaN where the method has none */
  double ledger_energy_joule; /* credit of the hand; NaN where the method has none */
  double lease_s;             /* longest time for which the force may act; 0: the setting lease_s */
  int is_clamped;             /* the force differs from the request */
  int is_too_fast;            /* the hand moved faster than the controller assumes */
} palpate_output;

/* "0.1.0" */
PALPATE_API const char* palpate_controllers_version(void);

/* The names of the controllers, 0 .. count - 1; NULL beyond. */
PALPATE_API size_t palpate_controller_count(void);
PALPATE_API const char* palpate_controller_name(size_t index);
/* The names of the settings and their units. A controller ignores those of others. */
PALPATE_API size_t palpate_setting_count(void);
PALPATE_API const char* palpate_setting_name(size_t index);
PALPATE_API const char* palpate_setting_unit(size_t index);

/* With default settings; NULL if there is no controller of that name, or no memory. */
PALPATE_API palpate_controller* palpate_controller_create(const char* name);
PALPATE_API void palpate_controller_destroy(palpate_controller* controller); /* NULL is allowed */

/* Changes a setting and begins anew: before the first step, not between steps. A refused value
 * changes nothing. Of two settings that must be in order, set the larger first. */
PALPATE_API palpate_status palpate_controller_set(palpate_controller* controller,
                                                  const char* setting, double value);
PALPATE_API palpate_status palpate_controller_get(const palpate_controller* controller,
                                                  const char* setting, double* value);

/* Back to the initial state, for a new session of the device. Allocates nothing. */
PALPATE_API palpate_status palpate_controller_reset(palpate_controller* controller);
/* The force for this step. If the status is not PALPATE_OK the force is zero, and what acts until
 * the next step counts as not known. Allocates nothing, does not block. */
PALPATE_API palpate_status palpate_controller_step(palpate_controller* controller,
                                                   const palpate_input* input,
                                                   palpate_output* output);

/* What the last refused set() complains about: setting, value, rule. "" if nothing. */
PALPATE_API const char* palpate_controller_error(const palpate_controller* controller);

#ifdef __cplusplus
}
#endif

#endif /* PALPATE_CONTROLLERS_H */
