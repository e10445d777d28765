// Debounce, warm-up, the clock's wrap-around and the waits between tries.
#include "backoff.h"
#include "clock.h"
#include "motion_input.h"
#include "status_led.h"
#include "unit.h"

using patrol::Motion;
using patrol::MotionInput;

namespace {

constexpr patrol::MotionTiming kTiming = {60000, 5, 50, 600000};

/** Update every millisecond; returns the time of the first event, -1 for never. */
int64_t until(MotionInput* input, bool level, uint64_t from, uint64_t to, Motion expected) {
  for (uint64_t now = from; now <= to; ++now) {
    const Motion found = input->update(level, now);
    if (found == Motion::kNothing) continue;
    EQUAL(static_cast<int>(found), static_cast<int>(expected));
    return static_cast<int64_t>(now);
  }
  return -1;
}

MotionInput idle() {
  MotionInput input(kTiming);
  input.begin(false, 0);
  return input;
}

}  // namespace

TEST(motion_is_told_when_it_is_confirmed) {
  MotionInput input = idle();
  input.edge(100);
  EQUAL(until(&input, true, 101, 200, Motion::kBegan), 105);
  EQUAL(input.beganAt(), 100U);
  EQUAL(until(&input, true, 106, 5000, Motion::kBegan), -1);
}

TEST(motion_is_told_at_once_where_the_loop_was_late) {
  MotionInput input = idle();
  input.edge(100);
  CHECK(input.update(true, 130) == Motion::kBegan);
  EQUAL(input.beganAt(), 100U);
}

TEST(a_level_without_an_interrupt_counts_too) {
  MotionInput input = idle();
  EQUAL(until(&input, true, 100, 200, Motion::kBegan), 105);
}

TEST(spikes_are_no_motion) {
  MotionInput input = idle();
  input.edge(100);
  CHECK(input.update(false, 101) == Motion::kSpike);  // over before the first check
  input.edge(200);
  CHECK(input.update(true, 202) == Motion::kNothing);
  CHECK(input.update(false, 204) == Motion::kSpike);
  input.edge(300);
  CHECK(input.update(true, 302) == Motion::kNothing);
  input.edge(304);  // low in between: the time counts from the second edge
  CHECK(input.update(true, 306) == Motion::kNothing);
  CHECK(input.update(true, 309) == Motion::kBegan);
  EQUAL(input.beganAt(), 304U);
}

TEST(bounces_at_the_end_are_the_same_motion) {
  MotionInput input = idle();
  input.edge(100);
  CHECK(input.update(true, 106) == Motion::kBegan);
  CHECK(input.update(false, 3000) == Motion::kNothing);
  input.edge(3010);
  EQUAL(until(&input, true, 3010, 3020, Motion::kBegan), -1);
  EQUAL(until(&input, false, 3021, 3100, Motion::kEnded), 3071);
  CHECK(!input.active());
  input.edge(3200);
  EQUAL(until(&input, true, 3200, 3300, Motion::kBegan), 3205);
}

TEST(nothing_counts_while_it_warms_up) {
  MotionInput input(kTiming);
  input.begin(true, 1000);
  CHECK(input.warming());
  EQUAL(input.warmUpLeft(31000), 30000U);
  input.edge(2000);
  EQUAL(until(&input, true, 2000, 60000, Motion::kBegan), -1);
  EQUAL(until(&input, false, 60001, 70000, Motion::kWarm), 61000);
  CHECK(!input.warming());
  input.edge(61100);
  EQUAL(until(&input, true, 61100, 62000, Motion::kBegan), 61105);
}

TEST(what_began_while_it_was_cold_is_no_motion) {
  MotionInput input(kTiming);
  input.begin(true, 0);
  input.edge(59000);
  EQUAL(until(&input, true, 59000, 70000, Motion::kWarm), 60000);
  EQUAL(until(&input, true, 60001, 70000, Motion::kBegan), -1);
  EQUAL(until(&input, false, 70001, 70100, Motion::kEnded), 70051);
  EQUAL(until(&input, true, 70101, 70200, Motion::kBegan), 70106);
}

TEST(after_a_reset_the_module_is_warm_and_a_motion_that_goes_on_counts) {
  MotionInput input = idle();
  CHECK(!input.warming());
  EQUAL(input.warmUpLeft(5), 0U);
  EQUAL(until(&input, true, 1, 100, Motion::kBegan), 6);
}

TEST(an_output_that_stays_high_is_told_once_a_motion) {
  MotionInput input = idle();
  EQUAL(until(&input, true, 100, 200, Motion::kBegan), 105);
  EQUAL(until(&input, true, 201, 700000, Motion::kStuck), 600101);
  EQUAL(until(&input, true, 600102, 1300000, Motion::kStuck), -1);
}

TEST(the_clock_counts_on_where_the_board_wraps) {
  patrol::Clock clock(0xFFFFFF00U);
  EQUAL(clock.update(0xFFFFFFFFU), 255U);
  EQUAL(clock.update(0x00000010U), 272U);
  EQUAL(clock.timeOf(0xFFFFFFF0U), 240U);  // an interrupt before the wrap
  EQUAL(clock.timeOf(0x00000011U), 272U);  // newer than the reading
  uint64_t expected = 272;
  uint32_t raw = 0x10;
  for (int day = 0; day < 200; ++day) {
    raw += 86400000U;
    expected += 86400000U;
    EQUAL(clock.update(raw), expected);
    EQUAL(clock.timeOf(raw + 1), expected);
    EQUAL(clock.timeOf(raw - 5), expected - 5);
  }
}

TEST(an_interrupt_before_the_start_counts_from_the_start) {
  const patrol::Clock clock(1000);
  EQUAL(clock.timeOf(900), 0U);
}

TEST(waits_grow_and_differ) {
  patrol::Backoff backoff(250, 8000);
  EQUAL(backoff.next(0), 125U);
  EQUAL(backoff.next(500), 750U);  // 500 - 250 + 500
  for (int i = 0; i < 20; ++i) backoff.next(1);
  for (uint32_t random = 0; random < 20000; random += 7) {
    const uint32_t wait = backoff.next(random);
    CHECK(wait >= 4000 && wait <= 12000);
  }
  backoff.reset();
  EQUAL(backoff.next(0xFFFFFFFFU), 125 + 0xFFFFFFFFU % 251);
}

TEST(the_led_tells_states_apart) {
  using patrol::SensorState;
  const auto share = [](SensorState state) {
    int on = 0;
    for (uint64_t now = 0; now < 10000; ++now) on += patrol::ledOn(state, now) ? 1 : 0;
    return on;
  };
  EQUAL(share(SensorState::kMotion), 10000);
  EQUAL(share(SensorState::kNoNetwork), 5000);
  EQUAL(share(SensorState::kNoBridge), 5000);
  EQUAL(share(SensorState::kWarming), 1000);
  EQUAL(share(SensorState::kGuarding), 60);
}
