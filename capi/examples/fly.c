/* A flight among eight sensors: planned, read, and planned anew when it was seen that one of them has moved.
 *
 * Prints the bits of what it finds, which are the same on a host and on a microcontroller. Memory is the caller's: here a
 * static array.
 */
#include <stddef.h>
#include <stdint.h>

#include "port.h"
#include "quietpath.h"

#define SENSORS 8

/* As much as `quietpath_size()` says, with some to spare. */
static _Alignas(8) uint8_t memory[56 * 1024];

static const float places[SENSORS][2] = {
    {2.0f, 2.0f}, {5.0f, 1.5f}, {8.0f, 2.5f}, {1.5f, 5.5f}, {4.8f, 5.0f}, {8.2f, 5.2f}, {3.0f, 8.3f}, {7.0f, 8.4f},
};

static void print_bits(float number)
{
    union {
        float number;
        uint32_t bits;
    } both = {number};
    char text[10] = " ";
    for (int digit = 0; digit < 8; digit++)
        text[1 + digit] = "0123456789abcdef"[both.bits >> (28 - 4 * digit) & 15];
    port_print(text);
}

static void print_plan(const QuietpathPlanner *planner)
{
    QuietpathNode nodes[QUIETPATH_INTERVALS_MAX + 1];
    size_t count = quietpath_read(planner, nodes, QUIETPATH_INTERVALS_MAX + 1);
    port_print("objective");
    print_bits(quietpath_objective(planner));
    for (size_t index = 0; index < count; index++) {
        port_print("\nnode");
        print_bits(nodes[index].time);
        print_bits(nodes[index].position[0]);
        print_bits(nodes[index].position[1]);
    }
    port_print("\n");
}

int main(void)
{
    QuietpathPlanner *planner = quietpath_create(memory, sizeof memory);
    if (planner == NULL) {
        port_print("memory is too small\n");
        return 1;
    }
    QuietpathAgent agent = {
        .start = {0.8f, 1.0f},
        .goal = {8.5f, 6.7f},
        .speed_max = 0.1f,
        .accel_max = 0.02f,
        .start_time = 0.0f,
        .time_target = 115.0f,
        .time_max = 300.0f,
        .time_penalty = 1.0f,
        .domain_min = {0.0f, 0.0f},
        .domain_max = {10.0f, 10.0f},
        .softening = 0.05f,
        .intervals = 32,
        .objective = QUIETPATH_OBJECTIVE_DETECTION,
    };
    QuietpathSensor sensors[SENSORS];
    for (size_t index = 0; index < SENSORS; index++)
        sensors[index] = (QuietpathSensor){
            .position = {places[index][0], places[index][1]},
            .detect_scale = 0.3f,
            .detect_epsilon = 0.3f,
            .range_c1 = 0.01f,
            .range_c2 = 0.1f,
            .path_loss = 2.0f,
        };
    /* Nothing can be planned before it is known what. */
    if (quietpath_plan(planner) != QUIETPATH_RESULT_ORDER)
        return 2;
    if (quietpath_set_agent(planner, &agent) != QUIETPATH_RESULT_OK ||
        quietpath_set_sensors(planner, sensors, SENSORS) != QUIETPATH_RESULT_OK ||
        quietpath_plan(planner) != QUIETPATH_RESULT_OK) {
        port_print("no plan\n");
        return 3;
    }
    print_plan(planner);

    /* A quarter of the flight later the agent is where the plan has it, and the sensor in the middle drifts north-west. */
    QuietpathNode nodes[QUIETPATH_INTERVALS_MAX + 1];
    quietpath_read(planner, nodes, QUIETPATH_INTERVALS_MAX + 1);
    float interval = nodes[9].time - nodes[8].time;
    float velocity[2] = {
        (nodes[9].position[0] - nodes[8].position[0]) / interval,
        (nodes[9].position[1] - nodes[8].position[1]) / interval,
    };
    sensors[4].time = nodes[8].time;
    sensors[4].velocity[0] = -0.02f;
    sensors[4].velocity[1] = 0.015f;
    if (quietpath_set_sensors(planner, sensors, SENSORS) != QUIETPATH_RESULT_OK ||
        quietpath_replan(planner, nodes[8].time, nodes[8].position, velocity) != QUIETPATH_RESULT_OK) {
        port_print("no new plan\n");
        return 4;
    }
    print_plan(planner);
    return 0;
}
