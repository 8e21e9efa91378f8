// One robot's EGM sessions as we see them: which datagrams count, when a session begins, when the robot is silent.
//
// The robot speaks first and counts its datagrams from 0 in each session; nothing in the protocol announces an end
// (reference/egm.md §2.1, §4). A robot that comes back after a silence either has counted on all the while, then the
// session goes on and so does the last reference, or it has begun anew, then everything begins at where it stands.
//
// UDP may deliver a datagram late, twice or after a newer one. The robot's number and its clock tell these from the
// next datagram of the session and from the first of another; where the clock has gone back, a silence and two in a row
// do. Accidents are meant, not a sender that forges both (docs/explanation/decisions/0055-threat-model.md).

#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>

#include "joints.hpp"

namespace core {

// How regularly the datagrams of one session arrive, by our clock and the robot's.
struct ArrivalValues {
    double jitter = 0.0;        // mean difference of two datagrams' delays, as RFC 3550 smooths it [s]
    double worst_jitter = 0.0;  // the largest such difference [s]
    // by how much the robot's clock is faster than ours, from the fastest datagrams of its first and its last full
    // second; 0 before the second of them
    double drift_ppm = 0.0;
    double cycle_time = 0.0;  // mean time between two datagrams that the robot sent, by our clock; 0 before the second
};

// Running estimates of that: a few additions for each datagram and no memory of them.
class Arrivals : public ArrivalValues {
public:
    // The first datagram of a session arrived, with a robot's time.
    void begin(double now, double robot_time) {
        *this = Arrivals{};
        first_arrival_ = now;
        set_clock(now, now - robot_time);
    }

    // Another arrived, after `sent` that the robot sent since the one before, itself included.
    void note(double now, double robot_time, std::int64_t sent) {
        const double offset = now - robot_time, deviation = std::abs(offset - offset_);
        count_ += sent;
        cycle_time = (now - first_arrival_) / double(count_);
        if (deviation > CLOCK_JUMP) return set_clock(now, offset);
        offset_ = offset;
        jitter += (deviation - jitter) / SMOOTHING;
        worst_jitter = std::max(worst_jitter, deviation);
        if (offset < lowest_) lowest_ = offset, lowest_at_ = now;
        if (now < window_end_) return;
        if (!before_)
            before_ = Lowest{lowest_, lowest_at_};
        else
            drift_ppm = (before_->offset - lowest_) / (lowest_at_ - before_->at) * 1e6;
        lowest_ = INFINITY, window_end_ = now + WINDOW;
    }

private:
    static constexpr double SMOOTHING = 16.0;  // of the jitter, as in RFC 3550
    static constexpr double WINDOW = 1.0;      // [s] in which the fastest datagram is taken as undelayed
    static constexpr double CLOCK_JUMP = 1.0;  // [s] by which a clock was set, not a datagram delayed

    struct Lowest {
        double offset, at;
    };

    void set_clock(double now, double offset) {
        offset_ = lowest_ = offset;
        lowest_at_ = now;
        before_.reset();
        window_end_ = now + WINDOW;
    }

    std::int64_t count_ = 0;
    double first_arrival_ = 0.0;
    double offset_ = 0.0, lowest_ = 0.0, lowest_at_ = 0.0, window_end_ = 0.0;
    std::optional<Lowest> before_;
};

// What happened on the wire since the start, in datagrams; as SessionCounters in egm/egm_session.py.
struct SessionCounters {
    std::int64_t received = 0;   // that count
    std::int64_t lost = 0;       // that the robot sent in a session and that never arrived
    std::int64_t late = 0;       // that waited together with a newer one, which was answered instead
    std::int64_t stale = 0;      // that arrived after a newer one was answered
    std::int64_t repeated = 0;   // that arrived before
    std::int64_t malformed = 0;  // that are no EGM of such a robot
};

// What Python reads of a session; as SessionValues in library.py.
struct SessionValues {
    enum State : std::int64_t {
        NONE,     // no robot has been heard
        BEGUN,    // open, and the message accepted last is of a session that began with it, or with one just before it
        RESUMED,  // the same of a session that has outlived a silence
        OPEN,
        SILENT,
    };

    State state = NONE;
    std::int64_t number = 0;  // of the session, 0 before the first
    // Robot time from the message that was to be answered before to the one accepted last; 0 where that is the first of
    // a session, or after a silence.
    double period = 0.0;
    SessionCounters counters;
    ArrivalValues arrivals;
};

class Session : public SessionValues {
public:
    // A robot that says nothing for longer than `silence` is lost.
    explicit Session(double silence) : silence_(silence) {}

    bool is_accepted = false;  // whether anything that waited together is to be answered

    // What arrives from now on waits together.
    void begin_batch() {
        if (state == BEGUN || state == RESUMED) state = OPEN;
        is_accepted = false;
        before_ = last_;
    }

    // Whether a message of this number and the robot's time is newer than all before it: the session's next one, or the
    // first of another.
    bool takes(std::uint32_t seqno, double robot_time, double now) {
        const Heard heard{seqno, robot_time, now};
        const std::int64_t ahead = last_ ? ahead_of(last_->seqno, seqno) : 0;
        const Verdict verdict = judge(heard, ahead);
        if (verdict == LATE || verdict == OLD) {
            count_old(seqno, -ahead);
            if (verdict == OLD && (!set_aside_ || now - set_aside_->arrival >= APART)) set_aside_ = heard;
            return false;
        }
        verdict == CONTINUES ? go_on(ahead) : begin(heard);
        ++counters.received;
        counters.late += is_accepted;
        is_accepted = true;
        const double passed = before_ ? robot_time - before_->time : 0.0;
        period = state != OPEN ? 0.0 : 0.0 < passed && passed <= LONGEST_PERIOD ? passed : CYCLE;
        last_ = heard, set_aside_.reset();
        return true;
    }

    // The number of our next datagram in this session.
    std::uint32_t next_seqno() { return reply_seqno_++; }

    // After the reply: take the message accepted last into the statistics.
    void settle() {
        if (sent_ && last_) arrivals_.note(last_->arrival, last_->time, sent_);
        sent_ = 0, arrivals = arrivals_;
    }

    // Time since the last datagram that counted.
    double silence(double now) const { return last_ ? now - last_->arrival : INFINITY; }

    // Whether the robot has been silent for too long.
    bool is_lost(double now) const { return silence(now) > silence_; }

    // Close the session when the robot has been silent for too long; whether it was closed now.
    bool close_if_silent(double now) {
        if (state == NONE || state == SILENT || !is_lost(now)) return false;
        state = SILENT;
        return true;
    }

private:
    // of the newest numbers are remembered: what is counted as lost may still arrive
    static constexpr int REORDERED = 16;
    // a number higher by more is none of the session: that is a silence
    static constexpr std::int64_t LARGEST_GAP = 64;
    // [s] without an accepted datagram: from then on the robot's clock may go back, the controller was restarted
    static constexpr double LONG_SILENCE = 1.0;
    static constexpr double APART = 0.002;  // [s] what arrives sooner after something else may have waited with it
    static constexpr double SLOWEST = 1.0;  // [s] at most from one datagram of a robot to its next, by its clock
    static constexpr double LONGEST_PERIOD = 0.100;  // [s] the robot's clock is not believed beyond this
    // by such a share, and so much [s], the time for datagrams may differ from their number; after a long silence, too:
    // EGM may have been stopped meanwhile, the arm moved, and EGM started again
    static constexpr double DRIFT = 0.05, LARGEST_DRIFT = 0.1;
    static constexpr std::uint32_t WINDOW = (2u << REORDERED) - 1;

    struct Heard {
        std::uint32_t seqno;
        double time, arrival;
    };

    // How many datagrams a message was sent after another; the robot's count wraps.
    static std::int64_t ahead_of(std::uint32_t before, std::uint32_t seqno) { return std::int32_t(seqno - before); }

    enum Verdict { CONTINUES, BEGINS, LATE, OLD };

    // What a datagram is, so far ahead of the one accepted last; in the order of the table of docs/reference/egm.md.
    Verdict judge(const Heard& heard, std::int64_t ahead) const {
        if (!last_) return BEGINS;
        const double later = heard.time - last_->time, silence = heard.arrival - last_->arrival;
        const bool is_open = state != SILENT && (silence <= silence_ || ahead == 1);
        // A robot whose clock went back meanwhile may count and keep time by chance as the session would have.
        const bool is_of_session = agree(ahead, later) && (ahead <= 0 || !set_aside_);
        if (ahead > 0 && (is_open ? ahead <= LARGEST_GAP && later >= 0.0 : is_of_session)) return CONTINUES;
        if (later > 0.0 && (is_open || !is_of_session)) return BEGINS;
        // A datagram of the session comes late by a few, not by many: a simulated robot that was restarted may count
        // and keep time exactly as the first time.
        if (is_of_session && -REORDERED <= ahead) return LATE;
        return silence > LONG_SILENCE && set_aside_ && is_next(*set_aside_, heard) ? BEGINS : OLD;
    }

    // Whether one datagram comes after another of the same robot, whatever its pace is: what is late fits no robot that
    // was restarted, nor does it come alone.
    static bool is_next(const Heard& before, const Heard& heard) {
        const std::int64_t ahead = ahead_of(before.seqno, heard.seqno);
        const double later = heard.time - before.time, apart = heard.arrival - before.arrival;
        return apart >= APART && 0 < ahead && ahead <= LARGEST_GAP && 0.0 <= later && later <= SLOWEST * double(ahead);
    }

    // Whether the robot's clock has gone on by the time of so many datagrams, or back where these are negative. Our
    // clock does not count: a virtual robot stands still with us on a machine that stalls.
    bool agree(std::int64_t ahead, double later) const {
        const double measured = arrivals_.cycle_time, cycle = measured != 0.0 ? measured : CYCLE;
        return std::abs(later - double(ahead) * cycle) <= cycle + std::min(DRIFT * std::abs(later), LARGEST_DRIFT);
    }

    void go_on(std::int64_t ahead) {
        if (state == SILENT) state = RESUMED;
        counters.lost += ahead - 1;
        seen_ = ahead > REORDERED ? 1 : (seen_ << ahead | 1) & WINDOW;
        sent_ += ahead;
    }

    void begin(const Heard& heard) {
        state = BEGUN;
        ++number;
        reply_seqno_ = 0, sent_ = 0, seen_ = 1, first_seqno_ = heard.seqno;
        arrivals_.begin(heard.arrival, heard.time);
        arrivals = arrivals_;
    }

    // Count a datagram that is left aside; what belongs to another session is stale, too.
    void count_old(std::uint32_t seqno, std::int64_t behind) {
        const bool is_remembered = 0 <= behind && behind <= REORDERED;
        const bool is_repeated = is_remembered && (seen_ >> behind & 1);
        ++(is_repeated ? counters.repeated : counters.stale);
        if (is_remembered && !is_repeated && ahead_of(first_seqno_, seqno) >= 0) {
            --counters.lost;  // it was counted as such when a newer one came
            seen_ |= 1u << behind;
        }
    }

    double silence_;
    Arrivals arrivals_;
    std::optional<Heard> last_, before_;  // accepted last, and when what waits together began to be taken
    std::optional<Heard> set_aside_;      // an older one of another session since; of what came together, the first
    std::uint32_t first_seqno_ = 0;
    std::uint32_t seen_ = 0;     // a bit for each of the newest numbers, bit 0 for the last
    std::int64_t sent_ = 0;      // datagrams that the robot sent since the one settled last
    std::uint32_t reply_seqno_ = 0;
};

}  // namespace core
