# SPDX-License-Identifier: Apache-2.0
"""Finds what can be mutated in a C++ source, with libclang, and writes the source anew with every
mutant in it (mutant.h).

Operators:
  arithmetic   + ↔ −, * ↔ /, += ↔ −=, *= ↔ /=, −x → x
  relation     < ↔ ≤, > ↔ ≥; a relation or another condition → true, → false (a loop's: → false)
  logic        && ↔ ||
  constant     c → 0, c → 2c, 0 → 1 (floating point); i → i + 1, of a loop's condition i − 1
               (integer); true ↔ false. A named constant where it is used, a literal where it stands
  limit        min(a, b), max(a, b) → a, → b; clamp(x, a, b) → max(x, a), → min(x, b); |x| → x;
               cwiseMin ↔ cwiseMax
  statement    dropped: an expression, break, continue; return x → return {}
"""

import re
from dataclasses import dataclass, field

from clang import cindex
from clang.cindex import CursorKind as K, TypeKind

FLOATS = {TypeKind.DOUBLE, TypeKind.FLOAT}
INTEGERS = {TypeKind.INT, TypeKind.UINT, TypeKind.LONG, TypeKind.ULONG, TypeKind.LONGLONG,
            TypeKind.ULONGLONG, TypeKind.SHORT, TypeKind.USHORT, TypeKind.UCHAR, TypeKind.SCHAR}
FUNCTIONS = {K.FUNCTION_DECL, K.CXX_METHOD, K.CONSTRUCTOR, K.DESTRUCTOR, K.FUNCTION_TEMPLATE,
             K.CONVERSION_FUNCTION}
CLASSES = {K.CLASS_DECL, K.STRUCT_DECL, K.CLASS_TEMPLATE,
           K.CLASS_TEMPLATE_PARTIAL_SPECIALIZATION}
# what the compiler needs to know, or what has no code
CONSTANT = {K.STATIC_ASSERT, K.ENUM_DECL, K.TYPE_ALIAS_DECL, K.TYPEDEF_DECL, K.USING_DECLARATION,
            K.TEMPLATE_TYPE_PARAMETER, K.TEMPLATE_NON_TYPE_PARAMETER, K.TYPE_REF, K.TEMPLATE_REF,
            K.NAMESPACE_REF, K.CXX_ACCESS_SPEC_DECL, K.PARM_DECL}
LOOPS = {K.WHILE_STMT, K.DO_STMT, K.FOR_STMT}
ARITHMETIC = {"+": "-", "-": "+", "*": "/", "/": "*", "+=": "-=", "-=": "+=", "*=": "/=",
              "/=": "*="}
BOUNDARY = {"<": "<=", "<=": "<", ">": ">=", ">=": ">"}
RELATIONS = {"<", "<=", ">", ">=", "==", "!="}
REMOVED = "(removed)"


@dataclass
class Site:
    """A place in a source with all its mutants: an expression, or a statement with its semicolon."""
    start: int
    end: int
    function: str
    kind: str = "expression"  # or "statement", "return"
    cast: str = "{}"          # gives every variant and the original one type
    variants: list = field(default_factory=list)


@dataclass
class Mutant:
    number: int
    room: str
    file: str
    line: int
    function: str
    context: str  # its lines, with the place between « and »
    text: str     # what stands there in the mutant

    @property
    def key(self):
        return (self.file, self.function, self.context, self.text)


class Source:
    """One file: its sites, and its text with every mutant in it."""

    def __init__(self, path, name, arguments):
        """@param name  the file as users know it, relative to the root of the tree"""
        self.name = name
        with open(path, "rb") as file:
            self.bytes = file.read()
        options = cindex.TranslationUnit.PARSE_DETAILED_PROCESSING_RECORD
        unit = cindex.Index.create().parse(path, args=arguments, options=options)
        errors = [str(d) for d in unit.diagnostics if d.severity >= cindex.Diagnostic.Error]
        if errors:
            raise ValueError("\n".join(errors[:3]))
        self.sites = {}
        self.macros = [self.range_of(c) for c in unit.cursor.get_children()
                       if c.kind == K.MACRO_INSTANTIATION and self.is_here(c, path)]
        for child in unit.cursor.get_children():
            if self.is_here(child, path) and not child.kind.is_preprocessing():
                self.visit(child, [])

    @staticmethod
    def is_here(cursor, path):
        return cursor.location.file is not None and cursor.location.file.name == path

    @staticmethod
    def range_of(cursor):
        return cursor.extent.start.offset, cursor.extent.end.offset

    def text(self, start, end):
        return self.bytes[start:end].decode()

    def text_of(self, cursor):
        return self.text(*self.range_of(cursor))

    # --- walk ---------------------------------------------------------------------------------

    def visit(self, cursor, parents):
        if cursor.kind in CONSTANT or self.is_in_macro(cursor):
            return
        children = list(cursor.get_children())
        if cursor.kind == K.VAR_DECL and "constexpr" in self.head_of(cursor, children):
            return
        if cursor.kind == K.CASE_STMT:
            children = children[1:]
        self.mutate(cursor, children, parents)
        for child in children:
            is_argument = child.kind in (K.INTEGER_LITERAL, K.CXX_BOOL_LITERAL_EXPR,
                                         K.UNEXPOSED_EXPR, K.DECL_REF_EXPR) and \
                cursor.kind in (K.MEMBER_REF_EXPR, K.DECL_REF_EXPR)
            if is_argument and self.is_template_argument(cursor, child):
                continue
            is_type = cursor.kind in (K.VAR_DECL, K.FIELD_DECL) and \
                child.extent.end.offset <= cursor.location.offset
            if not is_type:
                self.visit(child, parents + [cursor])

    def head_of(self, cursor, children):
        return self.text(cursor.extent.start.offset, cursor.location.offset)

    def is_template_argument(self, cursor, child):
        before = self.text(cursor.extent.start.offset, child.extent.start.offset).rstrip()
        return before.endswith("<") or (before.endswith(",") and "<" in before)

    def is_in_macro(self, cursor):
        start, end = self.range_of(cursor)
        return any(a <= start and end <= b for a, b in self.macros)

    def mutate(self, cursor, children, parents):
        kind = cursor.kind
        if kind == K.COMPOUND_STMT:
            for child in children:
                self.drop(child, parents + [cursor])
        elif kind in (K.IF_STMT, K.WHILE_STMT, K.FOR_STMT, K.DO_STMT, K.CXX_FOR_RANGE_STMT):
            self.control(cursor, children, parents)
        elif kind == K.CONDITIONAL_OPERATOR:
            self.condition(children[0], parents)
        elif kind == K.RETURN_STMT and children:
            self.give_back(cursor, children[0], parents)
        elif kind in (K.BINARY_OPERATOR, K.COMPOUND_ASSIGNMENT_OPERATOR) and len(children) == 2:
            self.binary(cursor, children[0], children[1], parents)
        elif kind == K.UNARY_OPERATOR and children:
            self.unary(cursor, children[0], parents)
        elif kind == K.CALL_EXPR:
            self.call(cursor, children, parents)
        elif kind in (K.FLOATING_LITERAL, K.INTEGER_LITERAL, K.CXX_BOOL_LITERAL_EXPR):
            self.literal(cursor, parents)
        elif kind == K.DECL_REF_EXPR:
            self.named_constant(cursor, parents)

    def add(self, cursor, parents, texts, kind="expression", cast="{}", end=None):
        start, own_end = self.range_of(cursor)
        end = end or own_end
        if start >= end:
            return
        site = self.sites.setdefault((start, end, kind),
                                     Site(start, end, self.function_of(parents), kind, cast))
        if cast != "{}":
            site.cast = cast
        original = self.text(start, end)
        for text in texts:
            if text != original and text not in site.variants:
                site.variants.append(text)

    @staticmethod
    def function_of(parents):
        scopes = [p.spelling for p in parents if p.kind in CLASSES]
        functions = [p for p in parents if p.kind in FUNCTIONS]
        if not functions:
            return "::".join(scopes) or "(file)"
        function = functions[0]
        scopes = []
        owner = function.semantic_parent
        while owner is not None and owner.kind in CLASSES:
            scopes.insert(0, owner.spelling)
            owner = owner.semantic_parent
        return "::".join(scopes + [function.spelling.split("<")[0]])

    # --- statements ---------------------------------------------------------------------------

    def drop(self, cursor, parents):
        is_jump = cursor.kind in (K.BREAK_STMT, K.CONTINUE_STMT)
        if not (is_jump or cursor.kind.is_expression()) or self.is_in_macro(cursor):
            return
        end = cursor.extent.end.offset
        semicolon = re.match(rb"\s*;", self.bytes[end:end + 80])
        if semicolon and not self.text_of(cursor).startswith("static_cast<void>"):
            self.add(cursor, parents, [REMOVED], "statement", end=end + semicolon.end())

    def control(self, cursor, children, parents):
        inside = parents + [cursor]
        open_paren = self.bytes.find(b"(", cursor.extent.start.offset)
        close_paren = self.closing(open_paren)
        is_do = cursor.kind == K.DO_STMT
        for child in children:
            if is_do or child.extent.start.offset > close_paren:
                self.drop(child, inside)
        if cursor.kind in (K.CXX_FOR_RANGE_STMT, K.DO_STMT):
            return
        head = [c for c in children if c.extent.end.offset <= close_paren]
        if cursor.kind == K.FOR_STMT:
            semicolons = [i for i in range(open_paren, close_paren) if self.bytes[i:i + 1] == b";"]
            head = [c for c in head if len(semicolons) == 2 and
                    semicolons[0] < c.extent.start.offset < semicolons[1]]
        # of `if (auto x = …)` the parser names x as the condition
        ends_at = semicolons[1] if cursor.kind == K.FOR_STMT and len(semicolons) == 2 \
            else close_paren
        if head and head[-1].kind.is_expression() and \
                not self.text(head[-1].extent.end.offset, ends_at).strip():
            self.condition(head[-1], inside)

    def closing(self, open_paren):
        depth = 0
        for i in range(open_paren, len(self.bytes)):
            depth += {40: 1, 41: -1}.get(self.bytes[i], 0)
            if depth == 0:
                return i
        return open_paren

    def give_back(self, cursor, result, parents):
        if self.type_of(result).kind == TypeKind.BOOL:
            self.condition(result, parents)
            return
        is_plain = result.kind in (K.FLOATING_LITERAL, K.INTEGER_LITERAL) or \
            self.text_of(result) in ("{}", "nullptr", '""')
        function = next((p for p in reversed(parents) if p.kind in FUNCTIONS or
                         p.kind == K.LAMBDA_EXPR), None)
        if is_plain or function is None or function.kind == K.LAMBDA_EXPR:
            return
        given = function.result_type.get_canonical()
        if given.kind in (TypeKind.LVALUEREFERENCE, TypeKind.RVALUEREFERENCE, TypeKind.VOID) or \
                "auto" in self.head_of(function, []) or self.is_in_macro(cursor):
            return
        constructors = [c for c in given.get_declaration().get_children()
                        if c.kind == K.CONSTRUCTOR]
        if constructors and not any(c.is_default_constructor() for c in constructors):
            return
        end = self.bytes.find(b";", cursor.extent.end.offset) + 1
        self.add(cursor, parents, ["return {};"], "return", end=end)

    # --- conditions ---------------------------------------------------------------------------

    def condition(self, cursor, parents):
        """`cursor` decides something: each of its parts that && and || join becomes true, false."""
        cursor = self.bare(cursor)
        children = list(cursor.get_children())
        if cursor.kind == K.BINARY_OPERATOR and self.operator(*children) in ("&&", "||"):
            for child in children:
                self.condition(child, parents)
            return
        if cursor.kind == K.CXX_BOOL_LITERAL_EXPR or self.is_in_macro(cursor):
            return
        is_loop = bool(parents) and parents[-1].kind in LOOPS
        self.add(cursor, parents, ["false"] if is_loop else ["true", "false"],
                 cast="static_cast<bool>({})")

    def bare(self, cursor):
        while cursor.kind in (K.PAREN_EXPR, K.UNEXPOSED_EXPR):
            children = list(cursor.get_children())
            if len(children) != 1 or not children[0].kind.is_expression():
                break
            if cursor.kind == K.UNEXPOSED_EXPR and \
                    self.range_of(children[0]) != self.range_of(cursor):
                break
            cursor = children[0]
        return cursor

    # --- expressions --------------------------------------------------------------------------

    @staticmethod
    def type_of(cursor):
        return cursor.type.get_canonical()

    def sort_of(self, cursor):
        """number, eigen, duration, time_point or nothing of these"""
        kind = self.type_of(cursor)
        if kind.kind in FLOATS or kind.kind in INTEGERS:
            return "number"
        spelling = kind.spelling.replace("const ", "")
        for start, sort in (("Eigen::", "eigen"), ("std::chrono::duration", "duration"),
                            ("std::chrono::time_point", "time_point")):
            if spelling.startswith(start):
                return sort
        return ""

    def operator(self, left, right):
        return self.text(left.extent.end.offset, right.extent.start.offset).strip()

    def binary(self, cursor, left, right, parents):
        operator = self.operator(left, right)
        a, b = self.text_of(left), self.text_of(right)
        if operator == "&&":
            self.add(cursor, parents, [f"{a} || {b}"])
        elif operator == "||":
            a, b = (f"({x})" if "||" in x else x for x in (a, b))
            self.add(cursor, parents, [f"{a} && {b}"])
        elif operator in RELATIONS:
            is_loop = bool(parents) and parents[-1].kind in LOOPS
            texts = [f"{a} {BOUNDARY[operator]} {b}"] if operator in BOUNDARY and not is_loop else []
            if self.type_of(cursor).kind == TypeKind.BOOL:
                texts += ["false"] if is_loop else ["true", "false"]
            self.add(cursor, parents, texts)
        elif operator in ARITHMETIC:
            text = self.swapped(operator, a, b, self.sort_of(left), self.sort_of(right))
            if text:
                is_assignment = operator.endswith("=")
                is_number = self.sort_of(cursor) == "number"
                cast = "{}" if is_assignment or is_number else "palpate::mutation::value({})"
                self.add(cursor, parents, [text], cast=cast)

    @staticmethod
    def swapped(operator, a, b, left, right):
        """a and b with the opposite operator; empty if that is no valid expression"""
        other = ARITHMETIC[operator]
        if not left or not right:
            return ""
        if {left, right} & {"duration", "time_point"}:
            is_difference = left == right == "time_point"
            is_ratio = operator == "/" and left == right
            if is_difference or is_ratio or (operator == "*" and left == "number"):
                return ""
            if operator in "+-" and left != right and left != "time_point":
                return ""
        if operator in ("*", "*=") and right == "eigen":
            return f"{b} / ({a})" if left == "number" and operator == "*" else ""
        return f"{a} {other} {b}"

    def unary(self, cursor, operand, parents):
        sign = self.text(cursor.extent.start.offset, operand.extent.start.offset).strip()
        if sign == "!":
            self.add(cursor, parents, ["true", "false"])
        elif sign == "-" and operand.kind not in (K.FLOATING_LITERAL, K.INTEGER_LITERAL):
            sort = self.sort_of(operand)
            if sort in ("number", "eigen"):
                cast = "{}" if sort == "number" else "palpate::mutation::value({})"
                self.add(cursor, parents, [self.text_of(operand)], cast=cast)

    def call(self, cursor, children, parents):
        name = cursor.spelling
        text = self.text_of(cursor)
        if name.startswith("operator") and len(children) == 3:
            self.binary(cursor, children[0], children[2], parents)
        elif name == "operator-" and len(children) == 2:
            self.unary(cursor, children[1], parents)
        elif name == "operator!" and len(children) == 2:
            self.unary(cursor, children[1], parents)
        elif name in ("min", "max") and text.startswith(f"std::{name}"):
            arguments = [self.text_of(a) for a in cursor.get_arguments()]
            if len(arguments) == 2:
                explicit = re.match(r"std::\w+<([^(]*)>\(", text)
                if explicit:
                    arguments = [f"static_cast<{explicit[1]}>({a})" for a in arguments]
                self.add(cursor, parents, arguments)
            else:
                swapped = {"min": "max", "max": "min"}[name]
                self.add(cursor, parents, [text.replace(f"std::{name}", f"std::{swapped}", 1)])
        elif name == "clamp" and text.startswith("std::clamp(") and len(list(cursor.get_arguments())) == 3:
            x, low, high = [self.text_of(a) for a in cursor.get_arguments()]
            self.add(cursor, parents, [f"std::max({x}, {low})", f"std::min({x}, {high})"])
        elif name == "abs" and text.startswith("std::abs("):
            self.add(cursor, parents, [self.text_of(next(cursor.get_arguments()))])
        elif name in ("cwiseMin", "cwiseMax"):
            other = {"cwiseMin": "cwiseMax", "cwiseMax": "cwiseMin"}[name]
            head, _, tail = text.rpartition(f".{name}(")
            self.add(cursor, parents, [f"{head}.{other}({tail}"], cast="palpate::mutation::value({})")

    def literal(self, cursor, parents):
        text = self.text_of(cursor)
        if cursor.kind == K.CXX_BOOL_LITERAL_EXPR:
            self.add(cursor, parents, [{"true": "false", "false": "true"}.get(text, text)])
        elif cursor.kind == K.FLOATING_LITERAL:
            is_zero = float(text.rstrip("fF")) == 0.0
            self.add(cursor, parents, ["1.0"] if is_zero else ["0.0", f"2.0 * {text}"])
        elif re.fullmatch(r"(0x[0-9A-Fa-f]+|\d+)[uUlL]*", text):
            self.integer(cursor, text, parents)

    def integer(self, cursor, text, parents):
        # of the type that it becomes: no narrowing inside braces
        outer = [p for p in parents if self.range_of(p) == self.range_of(cursor)]
        kinds = [self.type_of(c) for c in outer + [cursor]]
        kind = next((k for k in kinds if k.kind in INTEGERS or k.kind in FLOATS), None)
        if kind is None:
            return
        is_bound = any(p.kind in LOOPS for p in parents[-4:]) and \
            not any(p.kind == K.COMPOUND_STMT for p in parents[-3:]) and \
            not any(p.kind in (K.DECL_STMT, K.VAR_DECL) for p in parents[-4:])
        spelling = kind.spelling.replace("const ", "")
        self.add(cursor, parents, [f"{text} {'-' if is_bound else '+'} 1"],
                 cast=f"static_cast<{spelling}>({{}})")

    def named_constant(self, cursor, parents):
        named = cursor.referenced
        if named is None or named.kind != K.VAR_DECL or not parents or \
                parents[-1].kind == K.MEMBER_REF_EXPR:
            return
        head = "".join(t.spelling + " " for t in named.get_tokens())[:200]
        kind = named.type.get_canonical().kind
        if "constexpr" not in head.split("=")[0].split("{")[0]:
            return
        text = self.text_of(cursor)
        if kind in FLOATS:
            self.add(cursor, parents, ["0.0", f"2.0 * {text}"])
        elif kind in INTEGERS:
            spelling = named.type.get_canonical().spelling.replace("const ", "")
            is_bound = any(p.kind in LOOPS for p in parents[-3:])
            self.add(cursor, parents, [f"{text} {'-' if is_bound else '+'} 1"],
                     cast=f"static_cast<{spelling}>({{}})")

    # --- the mutated text ---------------------------------------------------------------------

    def mutants(self, room, first_number):
        """Numbers the mutants, in the order of the source."""
        found = []
        self.numbers = {}
        for key in sorted(self.sites):
            site = self.sites[key]
            line_start = self.bytes.rfind(b"\n", 0, site.start) + 1
            line_end = self.bytes.find(b"\n", site.end)
            context = " ".join((self.text(line_start, site.start) + "«" +
                                self.text(site.start, site.end) + "»" +
                                self.text(site.end, line_end)).split())
            for text in site.variants:
                number = first_number + len(found)
                self.numbers.setdefault(key, []).append(number)
                found.append(Mutant(number, room, self.name,
                                    self.bytes.count(b"\n", 0, site.start) + 1, site.function,
                                    context, " ".join(text.split())))
        return found

    def schemata(self):
        """The source with every mutant of it."""
        # outer sites first; of two with one range the statement is outside
        order = sorted((k for k in self.sites if self.sites[k].variants),
                       key=lambda k: (k[0], -k[1], k[2] == "expression"))
        text, _ = self.render(0, len(self.bytes), order, 0)
        include = '#include "tests/mutation/mutant.h"\n'
        if "#pragma once\n" in text:
            return text.replace("#pragma once\n", "#pragma once\n" + include, 1)
        return include + text

    def render(self, start, end, order, i):
        """@return the text of start … end with the sites from order[i] on that lie in it, and the
        first site beyond"""
        pieces = []
        at = start
        while i < len(order) and order[i][1] <= end and order[i][0] < end:
            site = self.sites[order[i]]
            numbers = self.numbers[order[i]]
            inner, following = self.render(site.start, site.end, order, i + 1)
            pieces.append(self.text(at, site.start))
            pieces.append(self.choice(site, numbers, inner))
            at = site.end
            i = following
        pieces.append(self.text(at, end))
        return "".join(pieces), i

    @staticmethod
    def choice(site, numbers, inner):
        if site.kind == "statement":
            return f"{{ if (!palpate::mutation::on({numbers[0]}U)) {{ {inner} }} }}"
        if site.kind == "return":
            return f"{{ if (palpate::mutation::on({numbers[0]}U)) return {{}}; {inner} }}"
        choices = "".join(f"palpate::mutation::on({n}U) ? {site.cast.format(f'({v})')} : "
                          for n, v in zip(numbers, site.variants))
        return f"({choices}{site.cast.format(f'({inner})')})"
