// The states of the limiter, and the transitions between them; control/limiter_state.py has the table.

#pragma once

#include <cstdint>

namespace core {

// As LimiterState in control/limiter_state.py.
enum State : std::int64_t {
    NO_SESSION,
    ENTERING,
    BEGINNING,
    STANDBY,
    FOLLOWING,
    SETTLING,
    HOLDING,
    WAITING,
    IGNORED,
    DOUBTED,
    LOST,
    INTERRUPTED,
    DISCONNECTED,
    STATES,
};

// As LimiterEvent in control/limiter_state.py.
enum Event : std::int64_t {
    SESSION_ELSEWHERE,
    SESSION_LED,
    SESSION_NEW,
    SESSION_CONTINUED,
    FIRST_SENT,
    FEEDBACK_LOST,
    FEEDBACK_DOUBTED,
    NOT_FOLLOWING,
    IGNORING,
    REPEATING,
    BACK,
    UNDESIRED,
    UNUSABLE,
    DESIRED,
    INTERRUPTION,
    CONNECTION_LOST,
    UNANSWERED,
    EVENTS,
};

// An event in a state that has none such in the table: the program is wrong.
struct ForbiddenTransition {
    Event event;
};

// Of each state and event what follows, -1 where it is forbidden; and the states after which an arm has to settle
// before anything that is desired is taken.
struct StateTable {
    std::int8_t next[STATES][EVENTS];
    std::int8_t settles[STATES];
};

}  // namespace core
