/* quietpath for C and C++. Made from capi/src/lib.rs by `cargo xtask header`. */

#ifndef QUIETPATH_H
#define QUIETPATH_H

#include <stddef.h>
#include <stdint.h>

// Most intervals of a plan; nodes are one more.
#define QUIETPATH_INTERVALS_MAX 32

// Most sensors.
#define QUIETPATH_SENSORS_MAX 8

// What a call came to.
typedef enum QuietpathResult {
  // There is a feasible plan.
  QUIETPATH_RESULT_OK = 0,
  // There is a plan, but it breaks a bound: the way is closed in the time there is.
  QUIETPATH_RESULT_INFEASIBLE = 1,
  // A pointer is null, or memory too small or not aligned.
  QUIETPATH_RESULT_MEMORY = 2,
  // Numbers or counts that describe no problem.
  QUIETPATH_RESULT_INVALID = 3,
  // Something has to be called before: agent and sensors are set, then planned, then read.
  QUIETPATH_RESULT_ORDER = 4,
} QuietpathResult;

// What is to be small or large along the path.
typedef enum QuietpathObjective {
  // Detected least.
  QUIETPATH_OBJECTIVE_DETECTION = 0,
  // Located worst: the area of the error ellipse, its logarithm. Needs three ranging sensors.
  QUIETPATH_OBJECTIVE_LOCATION = 1,
} QuietpathObjective;

// A planner, with all of its memory; its insides are its own.
typedef struct QuietpathPlanner QuietpathPlanner;

// The flight: who flies, from where to where, in what time and what box.
typedef struct QuietpathAgent {
  // East and north at the start, length units.
  float start[2];
  // East and north at arrival, length units.
  float goal[2];
  // Largest speed, length units per s.
  float speed_max;
  // Largest acceleration, length units per s^2.
  float accel_max;
  // Time at the start, s.
  float start_time;
  // Wanted time of arrival, s: later ones are penalised.
  float time_target;
  // Latest time of arrival, s.
  float time_max;
  // Weight of lateness, objective unit per s^2.
  float time_penalty;
  // Smallest coordinates of the box that the flight stays in, length units.
  float domain_min[2];
  // Largest coordinates of that box, length units.
  float domain_max[2];
  // Softening of every distance, length units, greater than 0.
  float softening;
  // Intervals of the plan, 2 to `QUIETPATH_INTERVALS_MAX`.
  uint32_t intervals;
  // What is wanted: a `QuietpathObjective`.
  uint32_t objective;
} QuietpathAgent;

// A sensor, as it was seen; it keeps its velocity.
typedef struct QuietpathSensor {
  // East and north, length units.
  float position[2];
  // Length units per s.
  float velocity[2];
  // When it was seen, s.
  float time;
  // Detection: `min(1, scale / (epsilon + d^path_loss))`; a scale of 0 for a sensor that does not detect.
  float detect_scale;
  // See `detect_scale`.
  float detect_epsilon;
  // Variance of its distance estimator: `c1 d^path_loss (1 + c2 d^path_loss)`; a c1 of 0 for a sensor that does not range.
  float range_c1;
  // See `range_c1`.
  float range_c2;
  // Path-loss exponent of both.
  float path_loss;
} QuietpathSensor;

// A node of a plan.
typedef struct QuietpathNode {
  // s.
  float time;
  // East and north, length units.
  float position[2];
} QuietpathNode;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// Bytes that a planner needs.
size_t quietpath_size(void);

// Alignment that a planner needs, bytes.
size_t quietpath_alignment(void);

// Makes a planner in `memory`, which has `bytes` bytes and stays the planner's; null where it is too small or not aligned.
//
// # Safety
// `memory` is null, or `bytes` bytes from there on are the caller's to give.
struct QuietpathPlanner *quietpath_create(void *memory,
                                          size_t bytes);

// Says who flies where. What was planned before is forgotten.
//
// # Safety
// `planner` is null or from `quietpath_create`; `agent` is null or points to an agent.
enum QuietpathResult quietpath_set_agent(struct QuietpathPlanner *planner,
                                         const struct QuietpathAgent *agent);

// Says what sensors there are, or how they were seen last. A plan stays in force until the next one.
//
// # Safety
// `planner` is null or from `quietpath_create`; `sensors` is null or points to `count` sensors.
enum QuietpathResult quietpath_set_sensors(struct QuietpathPlanner *planner,
                                           const struct QuietpathSensor *sensors,
                                           size_t count);

// Plans the whole flight, from nothing.
//
// # Safety
// `planner` is null or from `quietpath_create`.
enum QuietpathResult quietpath_plan(struct QuietpathPlanner *planner);

// Plans the rest of the flight from where the agent was found at `time` (s): position in length units, velocity in length
// units per s, east and north. The plan before is where it starts from, and stays in force where nothing better is found.
//
// # Safety
// `planner` is null or from `quietpath_create`; `position` and `velocity` are null or point to two numbers.
enum QuietpathResult quietpath_replan(struct QuietpathPlanner *planner,
                                      float time,
                                      const float *position,
                                      const float *velocity);

// Copies the plan in force to `nodes`, which has room for `capacity`; returns how many there are, also where there is no
// room for all.
//
// # Safety
// `planner` is null or from `quietpath_create`; `nodes` is null or has room for `capacity` nodes.
size_t quietpath_read(const struct QuietpathPlanner *planner,
                      struct QuietpathNode *nodes,
                      size_t capacity);

// Objective of the rest of the plan in force; NaN where there is none.
//
// # Safety
// `planner` is null or from `quietpath_create`.
float quietpath_objective(const struct QuietpathPlanner *planner);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* QUIETPATH_H */
