// Datagrams of EGM in joint mode: what the control loop reads of a robot's, and the references that answer it.
//
// The robot's message has more, which is left unread; degrees and microseconds stay in here (egm/egm.proto).

#pragma once

#include "joints.hpp"

namespace core {

constexpr std::size_t LARGEST_DATAGRAM = 1024;   // as in egm/codec.py
constexpr std::size_t LARGEST_REFERENCE = 160;   // of ours

// What the control loop uses of a robot's message; as JointReport in egm/joint_codec.py.
struct JointReport {
    std::int64_t seqno = 0;
    Values measured{}, planned{};  // [rad]
    double time = 0.0;             // by the robot's clock [s]
    std::int64_t motors = 0, mci = 0, rapid = 0;
};

// Whether a robot in these states follows. Undefined counts: a restart of the controller leaves RAPID's so
// (reference/egm.md §3.3).
inline bool is_running(std::int64_t motors, std::int64_t mci, std::int64_t rapid) {
    constexpr int MOTORS_ON = 1, MCI_RUNNING = 3, RAPID_STOPPED = 1;
    return motors == MOTORS_ON && mci == MCI_RUNNING && rapid != RAPID_STOPPED;
}

// Why a datagram is not read; as Unreadable in egm/codec.py.
struct Unreadable {
    enum Why : std::int64_t { NOTHING, TOO_LONG, NOT_DECODED, WRONG_TYPE, NO_TIME, NO_STATE, WRONG_AXES, IMPLAUSIBLE };

    std::int64_t why = NOTHING;
    std::int64_t part = 0;           // 2 feedBack, 3 planned, 4 motorState, 5 mciState, 8 rapidExecState
    std::int64_t number = 0;         // the type; or how many joints there are
    std::int64_t external = 0;       // and how many external ones
    double degrees[JOINTS] = {};     // of axes 1 to 6, and of the external one
};

// A message of protocol buffers, field by field. Whatever does not fit a field is skipped, as any reader must.
class WireReader {
public:
    WireReader(const unsigned char* begin, const unsigned char* end) : at_(begin), end_(end) {}

    int field = 0, type = 0;
    bool is_sound = true;

    bool is_over() const { return at_ == end_; }

    // Whether there is another field.
    bool next() {
        if (!is_sound || at_ == end_) return false;
        const std::uint64_t tag = varint();
        field = int(tag >> 3), type = int(tag & 7);
        if (tag >> 32 || field == 0) is_sound = false;
        return is_sound;
    }
    std::uint64_t varint() {
        std::uint64_t value = 0;
        for (int shift = 0; shift < 70; shift += 7) {
            if (at_ == end_) break;
            const unsigned char byte = *at_++;
            value |= shift < 64 ? std::uint64_t(byte & 0x7F) << shift : 0;
            if (!(byte & 0x80)) return value;
        }
        is_sound = false;
        return 0;
    }
    double number() {
        double value = 0.0;
        if (has(8)) {
            std::memcpy(&value, at_, 8);
            at_ += 8;
        }
        return value;
    }
    // What a field of bytes or of a message contains.
    WireReader inside() {
        const std::uint64_t size = varint();
        if (!has(size)) return {end_, end_};
        const unsigned char* begin = at_;
        at_ += size;
        return {begin, at_};
    }
    void skip(int depth = 0) {
        const int group = field;
        switch (type) {
            case VARINT: varint(); break;
            case FIXED_64: advance(8); break;
            case BYTES: inside(); break;
            case GROUP: skip_group(group, depth); break;
            case FIXED_32: advance(4); break;
            default: is_sound = false;  // the end of a group that did not begin, or no type
        }
    }

    enum Type { VARINT, FIXED_64, BYTES, GROUP, END_OF_GROUP, FIXED_32 };

private:
    static constexpr int DEEPEST = 100;  // of groups in groups

    void skip_group(int number, int depth) {
        while (depth < DEEPEST && next()) {
            if (type == END_OF_GROUP) {
                is_sound = field == number;
                return;
            }
            skip(depth + 1);
        }
        is_sound = false;
    }

    bool has(std::uint64_t size) {
        if (std::uint64_t(end_ - at_) < size) is_sound = false;
        return is_sound;
    }
    void advance(std::uint64_t size) {
        if (has(size)) at_ += size;
    }

    const unsigned char *at_, *end_;
};

class JointCodec {
public:
    // Whether a datagram is a complete message of a seven-axis robot; else why not.
    static bool decode(const void* datagram, std::size_t size, JointReport& report, Unreadable& unreadable) {
        unreadable = {};
        if (size > LARGEST_DATAGRAM) return refuse(unreadable, Unreadable::TOO_LONG);
        const auto* begin = static_cast<const unsigned char*>(datagram);
        Parts parts;
        if (!read({begin, begin + size}, [&](WireReader& field) { return parts.take(field); }))
            return refuse(unreadable, Unreadable::NOT_DECODED);
        if (parts.type != DATA || !parts.has_seqno) return refuse(unreadable, Unreadable::WRONG_TYPE, 0, parts.type);
        if (!parts.feedback.has_time) return refuse(unreadable, Unreadable::NO_TIME);
        for (int part : {4, 5, 8})
            if (!parts.has_state[part]) return refuse(unreadable, Unreadable::NO_STATE, part);
        report.seqno = parts.seqno;
        report.time = double(parts.feedback.seconds) + double(parts.feedback.microseconds) * 1e-6;
        report.motors = parts.state[4], report.mci = parts.state[5], report.rapid = parts.state[8];
        return take(parts.feedback, 2, report.measured, unreadable) &&
               take(parts.planned, 3, report.planned, unreadable);
    }

    // The datagram that gives an arm its position, and its velocity where there is one; 0 where a value is not finite:
    // a reference with NaN crashes the controller (reference/egm.md §4.5). Else its size, at most LARGEST_REFERENCE.
    static std::size_t encode(std::uint32_t seqno, const ArmCommand& command, unsigned char* datagram) {
        if (!command.is_finite()) return 0;
        unsigned char header[8] = {0x08}, *end = header + 1;
        for (; seqno > 0x7F; seqno >>= 7) *end++ = static_cast<unsigned char>(seqno | 0x80);
        *end++ = static_cast<unsigned char>(seqno);
        *end++ = 0x18, *end++ = CORRECTION;
        unsigned char* at = datagram;
        *at++ = 0x0A, *at++ = static_cast<unsigned char>(end - header);
        at = std::copy(header, end, at);
        at = put(0x12, command.position, at);
        if (command.has_velocity) at = put(0x1A, command.velocity, at);
        return std::size_t(at - datagram);
    }

private:
    static constexpr int DATA = 2, CORRECTION = 3;     // types of messages
    static constexpr double RAD_PER_DEG = M_PI / 180.0, DEG_PER_RAD = 180.0 / M_PI;
    static constexpr double FARTHEST = 7 * 400.0 * 400.0;  // of squares: no arm's joints turn by so much

    // Read a message whose fields `take` takes, or leaves to be skipped; whether all of it is sound.
    template <typename Take>
    static bool read(WireReader from, Take take) {
        while (from.next())
            if (!take(from)) from.skip();
        return from.is_sound;
    }
    // The same of a message in a field of another, which then is not sound either.
    template <typename Take>
    static bool read_inside(WireReader& from, Take take) {
        if (from.type != WireReader::BYTES) return false;
        if (!read(from.inside(), take)) from.is_sound = false;
        return true;
    }

    // A robot's measured or planned motion.
    struct Motion {
        double degrees[JOINTS] = {};  // of axes 1 to 6, and of the external one
        int axis_count = 0, external_count = 0;
        bool has_time = false;
        std::uint64_t seconds = 0, microseconds = 0;

        bool take(WireReader& from) {
            const int part = from.field;
            if (part != 1 && part != 3 && part != 4) return false;
            has_time = has_time || (part == 4 && from.type == WireReader::BYTES);
            return read_inside(from, [&](WireReader& field) {
                return part == 4 ? take_time(field) : take_joints(field, part == 3);
            });
        }
        bool take_joints(WireReader& from, bool are_external) {
            auto add = [&](double value) {
                if (are_external) {
                    if (external_count++ == 0) degrees[6] = value;
                } else if (axis_count++ < 6) {
                    degrees[axis_count - 1] = value;
                }
            };
            if (from.field != 1) return false;
            if (from.type == WireReader::FIXED_64) {
                add(from.number());
            } else if (from.type == WireReader::BYTES) {  // packed
                WireReader packed = from.inside();
                while (packed.is_sound && !packed.is_over()) add(packed.number());
                if (!packed.is_sound) from.is_sound = false;
            } else {
                return false;
            }
            return true;
        }
        bool take_time(WireReader& from) {
            if (from.type != WireReader::VARINT || (from.field != 1 && from.field != 2)) return false;
            (from.field == 1 ? seconds : microseconds) = from.varint();
            return true;
        }
    };

    struct Parts {
        bool has_seqno = false, has_state[9] = {};
        std::uint32_t seqno = 0;
        int type = 0, state[9] = {};
        Motion feedback, planned;

        bool take(WireReader& from) {
            const int part = from.field;
            const bool is_state = part == 4 || part == 5 || part == 8;
            if (part != 1 && part != 2 && part != 3 && !is_state) return false;
            if (is_state && from.type == WireReader::BYTES) has_state[part] = true;
            return read_inside(from, [&](WireReader& field) {
                if (is_state) return take_enum(field, 1, part == 5 ? 3 : 2, state[part]);
                if (part != 1) return (part == 2 ? feedback : planned).take(field);
                if (field.type != WireReader::VARINT || field.field != 1) return take_enum(field, 3, 4, type);
                seqno = std::uint32_t(field.varint()), has_seqno = true;
                return true;
            });
        }
        // A value that the enumeration does not have counts as none.
        static bool take_enum(WireReader& from, int number, int highest, int& value) {
            if (from.type != WireReader::VARINT || from.field != number) return false;
            const auto found = std::int32_t(from.varint());
            if (0 <= found && found <= highest) value = found;
            return true;
        }
    };

    static bool refuse(Unreadable& unreadable, Unreadable::Why why, int part = 0, std::int64_t number = 0) {
        unreadable.why = why, unreadable.part = part, unreadable.number = number;
        return false;
    }

    // Joints in chain order, of a part that has those of a YuMi.
    static bool take(const Motion& motion, int part, Values& joints, Unreadable& unreadable) {
        if (motion.axis_count != 6 || !motion.external_count) {
            unreadable.external = motion.external_count;
            return refuse(unreadable, Unreadable::WRONG_AXES, part, motion.axis_count);
        }
        const double* axes = motion.degrees;
        double square = 0.0;
        for (int i = 0; i < JOINTS; ++i) square += axes[i] * axes[i];
        if (!(square < FARTHEST)) {  // not a number fails every comparison
            std::copy(axes, axes + JOINTS, unreadable.degrees);
            return refuse(unreadable, Unreadable::IMPLAUSIBLE, part);
        }
        joints = {axes[0], axes[1], axes[6], axes[2], axes[3], axes[4], axes[5]};
        for (double& each : joints) each *= RAD_PER_DEG;
        return true;
    }

    // EgmPlanned or EgmSpeedRef with EgmJoints for axes 1 to 6 and for axis 7.
    static unsigned char* put(unsigned char tag, const Values& chain, unsigned char* at) {
        auto put_number = [&](double value) {
            value *= DEG_PER_RAD;
            *at++ = 0x09;
            std::memcpy(at, &value, 8);
            at += 8;
        };
        *at++ = tag, *at++ = 67, *at++ = 0x0A, *at++ = 54;
        for (int i : {0, 1, 3, 4, 5, 6}) put_number(chain[std::size_t(i)]);
        *at++ = 0x1A, *at++ = 9;
        put_number(chain[2]);
        return at;
    }
};

static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "the wire's numbers are copied as they are");

}  // namespace core
