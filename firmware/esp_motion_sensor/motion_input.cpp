#include "motion_input.h"

namespace patrol {

void MotionInput::begin(bool cold, uint64_t now) {
  warm_at_ = now + (cold ? timing_.warm_up : 0);
  began_at_ = since_ = now;
  edge_seen_ = stuck_told_ = false;
  state_ = cold && timing_.warm_up > 0 ? State::kWarming : State::kIdle;
}

void MotionInput::edge(uint64_t when) {
  if (!edge_seen_) edge_at_ = when;
  edge_seen_ = true;
}

Motion MotionInput::update(bool level, uint64_t now) {
  const bool rose = edge_seen_;
  edge_seen_ = false;
  switch (state_) {
    case State::kWarming:
      if (now < warm_at_) return Motion::kNothing;
      state_ = level ? State::kActive : State::kIdle;  // a level that rose during the warm-up is no motion
      began_at_ = now;
      stuck_told_ = false;
      return Motion::kWarm;

    case State::kIdle:
      if (!rose && !level) return Motion::kNothing;
      if (!level) return Motion::kSpike;
      since_ = rose ? edge_at_ : now;
      state_ = State::kRising;
      if (now - since_ < timing_.confirm) return Motion::kNothing;
      break;

    case State::kRising:
      if (!level) {
        state_ = State::kIdle;
        return Motion::kSpike;
      }
      if (rose) since_ = edge_at_;  // it was low in between
      if (now - since_ < timing_.confirm) return Motion::kNothing;
      break;

    case State::kActive:
      if (!level) {
        state_ = State::kEnding;
        since_ = now;
      } else if (!stuck_told_ && now - began_at_ > timing_.stuck) {
        stuck_told_ = true;
        return Motion::kStuck;
      }
      return Motion::kNothing;

    case State::kEnding:
      if (level) {
        state_ = State::kActive;
      } else if (rose) {
        since_ = now;
      } else if (now - since_ >= timing_.release) {
        state_ = State::kIdle;
        return Motion::kEnded;
      }
      return Motion::kNothing;
  }
  state_ = State::kActive;
  stuck_told_ = false;
  began_at_ = since_;
  return Motion::kBegan;
}

}  // namespace patrol
