// The door: what Python may call, and with which arguments. See library.py, which reads the descriptions.
//
// A function is called with one block of 8-byte words. A number takes one word, an array its address and its
// lengths, and a structure the address of one that Python has packed. The descriptions are made from the types of
// C++, so that both sides cannot differ; only the names of lengths, which have to agree, are written by hand, a
// letter for each axis of an array and a digit for a length that is fixed:
//
//     int64_t count_near(Array<const Vector> points, Array<uint8_t> is_near, double radius);
//     DOOR(count_near, "n n")
//
//     struct Walls { Array<const Vector> starts, ends; double height; };
//     LAYOUT(Walls, "w w", starts, ends, height)
//
// A function that returns bool returns whether its arguments belong together; if not, Python raises an EngineError.
// A structure of plain numbers is a row of a structured array, Array<const Robot>; any other is passed by reference.
#pragma once
#include "numbers.hpp"
#include <stdio.h>
#include <string.h>

namespace radarsim::door {

union Word {
    double number;
    int64_t integer;
    const void* address;
};

// Text of a limited length; what does not fit makes the description invalid, and no library with such a one opens.
class Text {
  public:
    void add(const char* text) {
        size_t length = strlen(text);
        if (used_ + length >= sizeof(memory_)) return;
        memcpy(memory_ + used_, text, length + 1);
        used_ += length;
    }
    void add(int64_t number) {
        char digits[24];
        snprintf(digits, sizeof(digits), "%lld", static_cast<long long>(number));
        add(digits);
    }
    const char* memory() const { return memory_; }

  private:
    char memory_[1 << 16] = {};
    size_t used_ = 0;
};

// The names of the lengths of arrays: a letter for each axis, or a digit for a length that is given; a blank after
// each array.
class Lengths {
  public:
    explicit Lengths(const char* names) : names_(names) {}
    void describe(Text& text, int axes) {
        for (int i = 0; i < axes && *names_; i++) {
            char name[2] = {*names_++, 0};
            text.add(name);
            if (i + 1 < axes) text.add(",");
        }
        if (*names_ == ' ') names_++;
    }

  private:
    const char* names_;
};

// The code of a type in numpy, or the name of a structure.
template <typename T> struct Code { static constexpr const char* name = structure_name(static_cast<T*>(nullptr)); };
template <> struct Code<double> { static constexpr const char* name = "f8"; };
template <> struct Code<float> { static constexpr const char* name = "f4"; };
template <> struct Code<bool> { static constexpr const char* name = "?"; };
template <> struct Code<int8_t> { static constexpr const char* name = "i1"; };
template <> struct Code<int16_t> { static constexpr const char* name = "i2"; };
template <> struct Code<int32_t> { static constexpr const char* name = "i4"; };
template <> struct Code<int64_t> { static constexpr const char* name = "i8"; };
template <> struct Code<uint8_t> { static constexpr const char* name = "u1"; };
template <> struct Code<uint16_t> { static constexpr const char* name = "u2"; };
template <> struct Code<uint32_t> { static constexpr const char* name = "u4"; };
template <> struct Code<uint64_t> { static constexpr const char* name = "u8"; };
template <typename T> struct Code<const T> : Code<T> {};
template <typename T> requires(__is_enum(T)) struct Code<T> : Code<__underlying_type(T)> {};

// A number, or a row of numbers.
template <typename T> struct Element {
    static constexpr const char* name = Code<T>::name;
    static void describe_axes(Text&, const char*) {}
};
template <typename T, size_t N> struct Element<T[N]> {
    static constexpr const char* name = Element<T>::name;
    static void describe_axes(Text& text, const char* before) {
        text.add(before);
        text.add(int64_t(N));
        Element<T>::describe_axes(text, ",");
    }
};

template <typename T> struct IsConst { static constexpr bool value = false; };
template <typename T> struct IsConst<const T> { static constexpr bool value = true; };

// A parameter of a function, or a field of a structure.
template <typename T> struct Parameter { // a number
    static T read(const Word*& words) {
        if constexpr (__is_same(T, double)) return (words++)->number;
        else return T((words++)->integer);
    }
    static void describe(Text& text, Lengths&) { text.add(Code<T>::name); }
};
template <typename T, size_t N> struct Parameter<T[N]> { // numbers within a structure
    static void describe(Text& text, Lengths&) {
        text.add(Code<T>::name);
        text.add("[");
        text.add(int64_t(N));
        text.add("]");
    }
};
template <typename T, int D> struct Parameter<Array<T, D>> {
    static Array<T, D> read(const Word*& words) {
        Array<T, D> array;
        array.data = static_cast<T*>(const_cast<void*>((words++)->address));
        for (int i = 0; i < D; i++) array.shape[i] = (words++)->integer;
        return array;
    }
    static void describe(Text& text, Lengths& lengths) {
        text.add(IsConst<T>::value ? "*" : "=");
        text.add(Element<T>::name);
        text.add("[");
        lengths.describe(text, D);
        Element<T>::describe_axes(text, ";");
        text.add("]");
    }
};
template <typename T> struct Parameter<const T&> {
    static const T& read(const Word*& words) { return *static_cast<const T*>((words++)->address); }
    static void describe(Text& text, Lengths&) {
        text.add("&");
        text.add(Code<T>::name);
    }
};
template <typename T> struct Parameter<const T*> : Parameter<const T&> {}; // a structure in another
template <> struct Parameter<void*> {
    static void describe(Text& text, Lengths&) { text.add("u8"); }
};

// Reads arguments from the first to the last, which only braces guarantee.
template <typename R, typename... A> struct Call {
    R result;
    Call(R (*function)(A...), A... arguments) : result(function(arguments...)) {}
};
template <typename... A> struct Call<void, A...> {
    Call(void (*function)(A...), A... arguments) { function(arguments...); }
};

template <auto F> struct Function;
template <typename R, typename... A, R (*F)(A...)> struct Function<F> {
    static R call(const Word* words) {
        if constexpr (__is_same(R, void)) Call<void, A...>{F, Parameter<A>::read(words)...};
        else return Call<R, A...>{F, Parameter<A>::read(words)...}.result;
    }
    static void describe(Text& text, Lengths& lengths) {
        ((Parameter<A>::describe(text, lengths), text.add(" ")), ...);
        if constexpr (__is_same(R, void)) text.add("-> none");
        else text.add("-> "), text.add(Code<R>::name);
    }
};

// One function, structure or enumeration, in the list of all.
struct Entry {
    const char *name, *lengths;
    const void* address; // of the function; null for others
    int64_t size;        // of the structure; 0 for others
    void (*describe)(Text&, Lengths&);
    const Entry* next;

    static inline const Entry* first = nullptr;
    Entry(const char* name, const char* lengths, const void* address, int64_t size, void (*describe)(Text&, Lengths&))
        : name(name), lengths(lengths), address(address), size(size), describe(describe), next(first) {
        first = this;
    }
};

// Write a line for each of them.
inline void describe_all(Text& text) {
    for (const Entry* entry = Entry::first; entry; entry = entry->next) {
        text.add(entry->name);
        text.add(" ");
        text.add(entry->address ? int64_t(entry->address) : entry->size);
        text.add(entry->address ? " function " : entry->size ? " structure " : " enumeration ");
        Lengths lengths(entry->lengths);
        entry->describe(text, lengths);
        text.add("\n");
    }
}

} // namespace radarsim::door

#define DOOR(function, lengths)                                                                                       \
    static const ::radarsim::door::Entry function##_entry{                                                            \
        #function, lengths, reinterpret_cast<const void*>(&::radarsim::door::Function<&function>::call), 0,           \
        &::radarsim::door::Function<&function>::describe};

// An enumeration that Python has as well, under the same names.
#define ENUMERATION(type, number, ...)                                                                                \
    enum class type : number { __VA_ARGS__ };                                                                         \
    inline void describe_##type(::radarsim::door::Text& text, ::radarsim::door::Lengths&) { text.add(#__VA_ARGS__); } \
    static const ::radarsim::door::Entry type##_entry{#type, "", nullptr, 0, &describe_##type};

// A macro for each of some names; C++20 has no other way to list the fields of a structure.
#define RADARSIM_EXPAND(...) RADARSIM_EXPAND_3(RADARSIM_EXPAND_3(RADARSIM_EXPAND_3(__VA_ARGS__)))
#define RADARSIM_EXPAND_3(...) RADARSIM_EXPAND_2(RADARSIM_EXPAND_2(RADARSIM_EXPAND_2(__VA_ARGS__)))
#define RADARSIM_EXPAND_2(...) RADARSIM_EXPAND_1(RADARSIM_EXPAND_1(RADARSIM_EXPAND_1(__VA_ARGS__)))
#define RADARSIM_EXPAND_1(...) __VA_ARGS__
#define RADARSIM_PARENTHESES ()
#define RADARSIM_EACH(macro, type, field, ...)                                                                        \
    macro(type, field) __VA_OPT__(RADARSIM_EACH_AGAIN RADARSIM_PARENTHESES(macro, type, __VA_ARGS__))
#define RADARSIM_EACH_AGAIN() RADARSIM_EACH
#define RADARSIM_FIELD(type, field)                                                                                   \
    text.add(#field " ");                                                                                             \
    text.add(int64_t(offsetof(type, field)));                                                                         \
    text.add(" ");                                                                                                    \
    Parameter<decltype(type::field)>::describe(text, lengths);                                                        \
    text.add(" ");

#define LAYOUT(type, lengths_, ...)                                                                                   \
    constexpr const char* structure_name(const type*) { return #type; }                                              \
    inline void describe_##type(::radarsim::door::Text& text, [[maybe_unused]] ::radarsim::door::Lengths& lengths) {  \
        using ::radarsim::door::Parameter;                                                                            \
        RADARSIM_EXPAND(RADARSIM_EACH(RADARSIM_FIELD, type, __VA_ARGS__))                                             \
    }                                                                                                                 \
    static const ::radarsim::door::Entry type##_entry{#type, lengths_, nullptr, sizeof(type), &describe_##type};
