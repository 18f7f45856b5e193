// Descriptions of the functions that Python can call, and of their arguments; library.py reads them.
//
// A function is called with a block of 8-byte words: a table that the class Arguments describes, and a word for each
// argument. This word is a number, the address of a Python object that must be a numpy array, or the address of a
// structure that Python has packed. The descriptions are generated from C++ types, so Python and C++ always agree. Only
// the lengths of arrays are described by hand: by a letter for each axis, where equal letters mean equal lengths, or by
// a digit for a fixed length:
//
//     int64_t count_near(Array<const Vector> points, Array<uint8_t> is_near, double radius);
//     BIND(count_near, "n n")
//
//     struct Walls { Array<const Vector> starts, ends; double height; };
//     LAYOUT(Walls, "w w", starts, ends, height)
//
//     struct Robot { double x, y; };
//     ROW(Robot, x, y)
//
// A function of type bool returns whether its arguments match each other; if not, Python raises an EngineError.
// Structures are either packed and passed by reference, or rows of structured arrays such as Array<const Robot>.
#pragma once
#include "numbers.hpp"
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

namespace radarsim::bindings {

// Result if a function was not called: REFUSED plus the number of the invalid argument. No function returns these
// numbers, and no arithmetic gives a NaN with these bits.
constexpr int64_t REFUSED = -(int64_t(1) << 50), NO_MEMORY = REFUSED + 127;

union Word {
    double number;
    int64_t integer;
    const void* address;
};

// A text buffer of limited length. A description that is too long is truncated, and the library cannot be opened.
class Text {
  public:
    __attribute__((format(printf, 2, 3))) void add(const char* format, ...) {
        if (used_ >= sizeof(memory_)) return;
        va_list values;
        va_start(values, format);
        used_ += vsnprintf(memory_ + used_, sizeof(memory_) - used_, format, values);
        va_end(values);
    }
    const char* memory() const { return memory_; }

  private:
    char memory_[1 << 16] = {};
    size_t used_ = 0;
};

// The memory layout of a numpy array behind the object head. It is the same in all versions, since compiled packages
// depend on it.
struct NumpyArray {
    void* data;
    int axes;
    const int64_t *lengths, *strides;
    const void *base, *dtype;
    int flags;
    static constexpr int CONTIGUOUS = 1, ALIGNED = 0x100, WRITEABLE = 0x400;
};

// Reads the arguments of a call, from the first to the last.
class Arguments {
  public:
    // The first word is the address of a table: the size of the object head, which ends with the pointer to the type;
    // the type of numpy arrays; and the dtype object of each array argument.
    Arguments(const Word* words, const char* lengths)
        : table_(static_cast<const Word*>(words->address)), dtype_(table_ + 2), word_(words), length_(lengths) {
        for (int64_t& length : known_) length = -1;
    }

    Word next() { return count_++, *++word_; }
    // Read an array. The lengths of its first axes have names, and its other axes have fixed lengths.
    NumpyArray next_array(bool is_written, int named, const int64_t* others, int axes) {
        auto head = static_cast<const char*>(next().address) + table_[0].integer;
        // Objects of other types may be shorter, so nothing behind their heads is read.
        bool fits = reinterpret_cast<const Word*>(head)[-1].address == table_[1].address;
        NumpyArray array = fits ? *reinterpret_cast<const NumpyArray*>(head) : NumpyArray{};
        int flags = NumpyArray::CONTIGUOUS | NumpyArray::ALIGNED | (is_written ? NumpyArray::WRITEABLE : 0);
        fits = fits && array.dtype == dtype_->address && (array.flags & flags) == flags && array.axes == axes;
        for (int i = 0; i < axes && fits; i++) {
            int64_t length = i < named ? length_named(length_[i], array.lengths[i]) : others[i - named];
            fits = array.lengths[i] == length;
        }
        dtype_++;
        while (*length_ && *length_++ != ' ') {}
        if (!fits && !refused_) refused_ = REFUSED + count_;
        return array;
    }
    // Return 0 if all arguments are valid, otherwise the code that Python receives instead of a result.
    int64_t refused() const { return refused_; }

  private:
    // Return the expected length of an axis: the length of the first axis with the same letter, or the value of the
    // digit.
    int64_t length_named(char name, int64_t length) {
        if (name <= '9') return name - '0';
        int64_t& known = known_[name - 'a'];
        return known < 0 ? known = length : known;
    }

    const Word *table_, *dtype_, *word_;
    const char* length_;
    int64_t known_[26], count_ = 0, refused_ = 0;
};

// The numpy code of a type, such as f8, or the name of a structure.
template <typename T> struct Code { static constexpr const char* name = structure_name(static_cast<T*>(nullptr)); };
template <typename T> struct Code<const T> : Code<T> {};
template <typename T> requires(__is_enum(T)) struct Code<T> : Code<__underlying_type(T)> {};
template <typename T> requires(!__is_class(T) && !__is_enum(T)) struct Code<T> { // a number
    static constexpr char kind = __is_same(T, bool) ? 'b' : T(0.5) != T(0) ? 'f' : T(-1) > T(0) ? 'u' : 'i';
    static constexpr char name[3] = {kind, char('0' + sizeof(T))};
};

// The element type of an array: a single number, or several numbers.
template <typename T> struct Element {
    static constexpr const char* name = Code<T>::name;
    static constexpr int axes = 0;
    static void fill(int64_t*) {}
};
template <typename T, size_t N> struct Element<T[N]> {
    static constexpr const char* name = Element<T>::name;
    static constexpr int axes = 1 + Element<T>::axes;
    static void fill(int64_t* lengths) {
        lengths[0] = N;
        Element<T>::fill(lengths + 1);
    }
};

template <> struct Element<Vector> : Element<double[3]> {};
template <> struct Element<const Vector> : Element<Vector> {};

template <typename T> struct IsConst { static constexpr bool value = false; };
template <typename T> struct IsConst<const T> { static constexpr bool value = true; };

// Reads and describes a parameter of a function, or a field of a structure.
template <typename T> struct Parameter { // a number
    static T read(Arguments& arguments) {
        if constexpr (__is_same(T, double)) return arguments.next().number;
        else return T(arguments.next().integer);
    }
    static void describe(Text& text, const char*&) { text.add("%s", Code<T>::name); }
};
template <typename T, size_t N> struct Parameter<T[N]> { // several numbers in a row of an array
    static void describe(Text& text, const char*&) { text.add("%s[%zu]", Code<T>::name, N); }
};
template <typename T, int D> struct Parameter<Array<T, D>> {
    static constexpr int axes = D + Element<T>::axes;
    static Array<T, D> read(Arguments& arguments) {
        int64_t others[Element<T>::axes + 1] = {};
        Element<T>::fill(others);
        NumpyArray found = arguments.next_array(!IsConst<T>::value, D, others, axes);
        Array<T, D> array = {static_cast<T*>(found.data), {}};
        for (int i = 0; i < D && !arguments.refused(); i++) array.shape[i] = found.lengths[i];
        return array;
    }
    static void describe(Text& text, const char*& names) {
        int64_t others[Element<T>::axes + 1] = {};
        Element<T>::fill(others);
        text.add("%c%s", IsConst<T>::value ? '*' : '=', Element<T>::name);
        for (int i = 0; i < axes; i++) {
            if (i < D) text.add("%c%c", i ? ',' : '[', *names++);
            else text.add("%c%d", i ? ',' : '[', int(others[i - D]));
        }
        text.add("]");
        if (*names == ' ') names++;
    }
};
template <typename T> struct Parameter<const T*> { // a structure in another structure
    static const T* read(Arguments& arguments) { return static_cast<const T*>(arguments.next().address); }
    static void describe(Text& text, const char*&) { text.add("&%s", Code<T>::name); }
};
template <typename T> struct Parameter<const T&> : Parameter<const T*> {
    static const T& read(Arguments& arguments) { return *Parameter<const T*>::read(arguments); }
};
template <> struct Parameter<void*> {
    static void* read(Arguments& arguments) { return const_cast<void*>(arguments.next().address); }
    static void describe(Text& text, const char*&) { text.add("u8"); }
};

// Calls a function if its arguments are valid. Arguments are read by initialisation with braces, since only this
// evaluates them from first to last.
template <typename R, typename... A> struct Call {
    int64_t result;
    Call(const Arguments& arguments, R (*function)(A...), A... values) : result(arguments.refused()) {
        if (result) return;
        if constexpr (__is_same(R, void)) function(values...);
        else if constexpr (__is_same(R, bool)) result = function(values...) ? 0 : REFUSED;
        else result = __builtin_bit_cast(int64_t, function(values...));
    }
};

template <auto F> struct Function;
template <typename R, typename... A, R (*F)(A...)> struct Function<F> {
    static int64_t call(const Word* words, const char* lengths) {
        Arguments arguments(words, lengths);
        int64_t result = NO_MEMORY;
        Attempt([&] { result = Call<R, A...>{arguments, F, Parameter<A>::read(arguments)...}.result; });
        return result;
    }
    static void describe(Text& text, const char* lengths) {
        ((Parameter<A>::describe(text, lengths), text.add(" ")), ...);
        text.add(__is_same(R, double) ? "-> f8" : "-> i8");
    }
};

// A function or structure in the linked list of all functions and structures.
struct Entry {
    const char *name, *kind, *lengths;
    int64_t size;                       // size of a structure in bytes
    int64_t (*call)(const Word* words); // calls the function, or fills the structure
    void (*describe)(Text&, const char* lengths);
    const Entry* next;

    static inline const Entry* first = nullptr;
    Entry(const char* name, const char* kind, const char* lengths, int64_t size, int64_t (*call)(const Word*),
          void (*describe)(Text&, const char*))
        : name(name), kind(kind), lengths(lengths), size(size), call(call), describe(describe), next(first) {
        first = this;
    }
};

// Write the description: a line for each function and structure.
inline void describe_all(Text& text) {
    for (const Entry* entry = Entry::first; entry; entry = entry->next) {
        auto address = reinterpret_cast<uintptr_t>(entry->call);
        text.add("%s%s%zu %zu ", entry->name, entry->kind, size_t(entry->size), size_t(address));
        entry->describe(text, entry->lengths);
        text.add("\n");
    }
}

} // namespace radarsim::bindings

#define BIND(function, lengths)                                                                                       \
    inline int64_t call_##function(const ::radarsim::bindings::Word* words) {                                         \
        return ::radarsim::bindings::Function<&function>::call(words, lengths);                                       \
    }                                                                                                                 \
    static const ::radarsim::bindings::Entry function##_entry{                                                        \
        #function, " function ", lengths, 0, &call_##function,                                                        \
        &::radarsim::bindings::Function<&function>::describe};

// An enumeration that is also available in Python, with the same names.
#define ENUMERATION(type, number, ...)                                                                                \
    enum class type : number { __VA_ARGS__ };                                                                         \
    inline void describe_##type(::radarsim::bindings::Text& text, const char*) { text.add(#__VA_ARGS__); }            \
    static const ::radarsim::bindings::Entry type##_entry{#type, " enumeration ", "", 0, nullptr, &describe_##type};

// Apply a macro to each name in a list; C++20 has no other way to list the fields of a structure.
#define RADARSIM_EXPAND(...) RADARSIM_EXPAND_3(RADARSIM_EXPAND_3(RADARSIM_EXPAND_3(__VA_ARGS__)))
#define RADARSIM_EXPAND_3(...) RADARSIM_EXPAND_2(RADARSIM_EXPAND_2(RADARSIM_EXPAND_2(__VA_ARGS__)))
#define RADARSIM_EXPAND_2(...) RADARSIM_EXPAND_1(RADARSIM_EXPAND_1(RADARSIM_EXPAND_1(__VA_ARGS__)))
#define RADARSIM_EXPAND_1(...) __VA_ARGS__
#define RADARSIM_PARENTHESES ()
#define RADARSIM_EACH(macro, type, field, ...)                                                                        \
    macro(type, field) __VA_OPT__(RADARSIM_EACH_AGAIN RADARSIM_PARENTHESES(macro, type, __VA_ARGS__))
#define RADARSIM_EACH_AGAIN() RADARSIM_EACH
#define RADARSIM_FIELD(type, field)                                                                                   \
    text.add(#field " %zu ", offsetof(type, field));                                                                  \
    Parameter<decltype(type::field)>::describe(text, names);                                                          \
    text.add(" ");
#define RADARSIM_FILL(type, field) packed.field = Parameter<decltype(type::field)>::read(arguments);

#define RADARSIM_STRUCTURE(type, kind, lengths, fill, ...)                                                            \
    constexpr const char* structure_name(const type*) { return #type; }                                               \
    inline void describe_##type(::radarsim::bindings::Text& text, [[maybe_unused]] const char* names) {               \
        using ::radarsim::bindings::Parameter;                                                                        \
        RADARSIM_EXPAND(RADARSIM_EACH(RADARSIM_FIELD, type, __VA_ARGS__))                                             \
    }                                                                                                                 \
    static const ::radarsim::bindings::Entry type##_entry{#type, kind, lengths, sizeof(type), fill, &describe_##type};
#define ROW(type, ...) RADARSIM_STRUCTURE(type, " row ", "", nullptr, __VA_ARGS__)
#define LAYOUT(type, lengths, ...)                                                                                    \
    inline int64_t fill_##type(const ::radarsim::bindings::Word* words) {                                             \
        using ::radarsim::bindings::Parameter;                                                                        \
        ::radarsim::bindings::Arguments arguments(words, lengths);                                                    \
        type& packed = *static_cast<type*>(const_cast<void*>(arguments.next().address));                              \
        RADARSIM_EXPAND(RADARSIM_EACH(RADARSIM_FILL, type, __VA_ARGS__))                                              \
        return arguments.refused();                                                                                   \
    }                                                                                                                 \
    RADARSIM_STRUCTURE(type, " structure ", lengths, &fill_##type, __VA_ARGS__)
