/* A controller exported by fpid_pin $version. Generated: change what made it, not this.
 *
 * Units: m, kg, s, rad, N m; of joints that slide m in place of rad, N in place of N m. Call
 * fpid_step() every FPID_STEP seconds, with what was measured just now, and apply the torque until
 * the next call. No memory is allocated, nothing is global but constants: several robots are several
 * states.
 */
#ifndef FPID_H
#define FPID_H

#ifdef __cplusplus
extern "C" {
#endif

/* The one precision of everything: double, or float with -DFPID_SINGLE. */
#ifdef FPID_SINGLE
typedef float real_t;
#else
typedef double real_t;
#endif

#define FPID_STEP $step /* [s] */
#define FPID_JOINTS $n

#define FPID_OK 0
/* An input is NaN or infinite: state and output are as before. */
#define FPID_BAD_INPUT 1
/* A torque is NaN or infinite: stop the drives; the state is of no use any more. */
#define FPID_BAD_TORQUE 2
/* The saved state is of another export. */
#define FPID_FOREIGN_STATE 3

$structs
typedef struct {
    int stamp;
$moving
} fpid_state;

/* Measured, and to be followed. */
typedef struct {
    real_t q[FPID_JOINTS];     /* [rad] */
    real_t v[FPID_JOINTS];     /* [rad/s] */
    real_t q_ref[FPID_JOINTS]; /* [rad] */
    real_t v_ref[FPID_JOINTS]; /* [rad/s] */
    real_t a_ref[FPID_JOINTS]; /* [rad/s^2] */
} fpid_input;

typedef struct {
    real_t torque[FPID_JOINTS]; /* within the effort limits [N m] */
} fpid_output;

/* Begin at t = 0. */
void fpid_reset(fpid_state *state);

/* Make one tick; returns FPID_OK, FPID_BAD_INPUT or FPID_BAD_TORQUE. */
int fpid_step(fpid_state *state, const fpid_input *input, fpid_output *output);

/* Go on from a copy of a state, gains and all, without a bump; it may have come from a file that
 * this build wrote. Returns FPID_OK, or FPID_FOREIGN_STATE: `state` is as before. */
int fpid_restore(fpid_state *state, const fpid_state *saved);

/* Which export this is: state.stamp must be it. */
#define FPID_STAMP $stamp

/* How far torques in double may be from the simulation's, as a part of the largest: fpid_check.c. */
#define FPID_TOLERANCE $tolerance

/* Constants, and states at t = 0: fpid_parameters.c. */
$declared

#ifdef __cplusplus
}
#endif

#endif
