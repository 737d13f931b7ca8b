/* One wheel: slew-limited PI speed loop with feed-forward. Pure: call it once per period. */
#ifndef CORE_WHEEL_H
#define CORE_WHEEL_H

#include <stdint.h>

#include "core/limits.h"

struct wheel {
    int32_t past_ticks[SPEED_WINDOW]; /* ring: the oldest stands at `oldest` */
    int32_t past_um_s[SPEED_WINDOW]; /* set-points of the same periods */
    uint8_t oldest;
    int32_t target_um_s;   /* what was ordered */
    int32_t setpoint_um_s; /* the target after the slew limit */
    int32_t speed_um_s;    /* measured over the last SPEED_WINDOW periods */
    int32_t integral;      /* of the error, in 1/INTEGRAL_ONE permille */
    int32_t um_s_per_pwm;  /* a free wheel's speed per permille of PWM: what all gains refer to */
    int16_t pwm;
};

/* Start at this encoder count, at rest, with an ordinary motor. */
void wheel_start(struct wheel *w, int32_t ticks);

/* Brake now: target, set-point, integral and PWM become zero without a slew. */
void wheel_brake(struct wheel *w);

/* One control period with the present encoder count; the new PWM is in w->pwm. */
void wheel_step(struct wheel *w, int32_t ticks);

#endif
