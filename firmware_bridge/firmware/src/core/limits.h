/* Every limit of the controller, in one place. Wheel speeds are um/s, PWM is permille. */
#ifndef CORE_LIMITS_H
#define CORE_LIMITS_H

#include <stdint.h>

#include "wire/messages.h"

/* Wheel loop */
#define CONTROL_PERIOD_US UINT32_C(10000)
#define SPEED_WINDOW 4u /* periods over which the encoder is differenced */
#define TICK_UM (INT32_C(1000000) / WIRE_TICKS_PER_METRE)
#define UM_S_PER_WINDOW_TICK (TICK_UM * INT32_C(1000000) / (INT32_C(10000) * (int32_t)SPEED_WINDOW))
#define MAX_WINDOW_TICKS INT32_C(2000) /* a faster count is a fault, not a speed */
#define PWM_MAX INT32_C(1000)
#define LEAD_PERIODS INT32_C(7)           /* feed-forward: pushes by the motor's 70 ms lag */
#define SPEED_UP_UM_S INT32_C(15000)      /* slew a period: 1.5 m/s^2 */
#define SLOW_DOWN_UM_S INT32_C(25000)     /* towards zero: 2.5 m/s^2 */
#define INTEGRAL_ONE INT32_C(1024)        /* the integral counts 1/1024 permille */
#define KI_GAIN INT32_C(120)              /* integral: 11.7 times the proportional part a second */

/* Reflexes */
#define STALL_SPEED_UM_S INT32_C(10000)
#define STALL_ORDER_UM_S INT32_C(50000)
#define STALL_PWM INT32_C(500)
#define STALL_US UINT32_C(600000)
#define OVER_CURRENT_MA 4000
#define OVER_CURRENT_US UINT32_C(100000)
#define BROWN_OUT_MV 9000u
#define BROWN_OUT_US UINT32_C(200000)
#define OVERRUN_US UINT32_C(25000)

/* Telemetry */
#define CONTACTS_MIN_GAP_US UINT32_C(5000)
#define STATUS_MIN_GAP_US UINT32_C(5000)

#define US_PER_MS UINT32_C(1000)

#endif
