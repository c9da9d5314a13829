"""Translate a kernel: Python's syntax tree -> LLVM IR."""

import ast
from collections.abc import Callable, Sequence

from llvmlite import ir

from filippov.base.elementary import LIBRARY
from filippov.kernel.language.operand import Operands
from filippov.kernel.language.pointer import StructPointer, spelt
from filippov.kernel.language.settled import settled
from filippov.kernel.language.strict import step_of
from filippov.kernel.language.unit import (
    BIT,
    DOUBLE,
    INDICES,
    LONG,
    VECTOR,
    VOID,
    Kernel,
    Unit,
)

_COMPARE = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!="}
_Test = Callable[[], ir.Value | None]
_CALLBACKS = {"call_field": 6, "call_guard": 5}


class _Body(Operands):
    """Translate one kernel.

    A local that one statement binds is the value it is bound to: that statement comes before every use
    (`strict`). Others live on the stack; LLVM's mem2reg turns them into registers.
    """

    def __init__(self, unit: Unit, kernel: Kernel) -> None:
        super().__init__(unit, kernel)
        self.flags = kernel.flags
        self.changing = kernel.changing
        self.locals: dict[str, ir.Value] = {}
        self.loops: list[tuple[ir.Block, ir.Block]] = []
        for argument, value in zip(kernel.node.args.args, kernel.function.args, strict=True):
            self.store(argument.arg, value)
        self.block(kernel.node.body)
        if not self.b.block.is_terminated:
            if kernel.function.ftype.return_type == VOID:
                self.b.ret_void()
            else:
                self.b.unreachable()  # `strict` has checked that every path returns
        self.entry.branch(kernel.function.blocks[1])

    # Values

    def test(self, node: ast.expr) -> ir.Value:
        """The condition of a branch: a single one, also in a lane kernel."""
        value = self.truth(node)
        if value.type != BIT:
            raise self.fail(node, "lanes cannot branch; blend, or ask anywhere(...) or everywhere(...)")
        return value

    def truth(self, node: ast.expr) -> ir.Value:
        """Whether a value is not 0; of `and` and `or` too, whose operands may be numbers here."""
        if isinstance(node, ast.BoolOp):
            return self.joined(node, self.truth)
        return self.bit(self.value(node))

    def settled(self, node: ast.expr) -> bool | None:
        """Whether a condition holds for every system with this unit; None where that is not known."""
        return settled(node, self.unit.fixed, self.locals)

    def condition(self, node: ast.expr) -> ir.Value:
        """An operand of `and` or `or` whose result is used as a value: in Python, one of the operands."""
        value = self.value(node)
        if value.type not in (BIT, self.wide_bit):
            raise self.fail(
                node, "`and` and `or` of numbers are numbers; compare them, or write a if ... else b"
            )
        return value

    def store(self, name: str, value: ir.Value, node: ast.AST | None = None) -> None:
        if self.kernel.wide and value.type == DOUBLE:
            value = self.splat(value)
        if name not in self.changing:
            self.locals[name] = value
            return
        if name not in self.locals:
            self.locals[name] = self.entry.alloca(value.type, name=name)
        slot = self.locals[name]
        self.b.store(self.cast(value, slot.type.pointee, node or self.kernel.node), slot)

    def value(self, node: ast.expr) -> ir.Value:
        method: Callable[[ast.expr], ir.Value] | None = getattr(self, f"value_{type(node).__name__}", None)
        if method is None:
            raise self.fail(node, f"{type(node).__name__} is not part of the kernel language")
        return method(node)

    def value_Constant(self, node: ast.Constant) -> ir.Value:
        if isinstance(node.value, bool | int | float):
            return self.constant(node.value, "")
        raise self.fail(node, "only numbers are constants")

    def value_Name(self, node: ast.Name) -> ir.Value:
        if node.id in self.locals:
            value = self.locals[node.id]
            return self.b.load(value) if node.id in self.changing else value
        if node.id in self.unit.constants:
            return self.constant(self.unit.constants[node.id], node.id)
        raise self.fail(node, f"unknown name {node.id}")

    def pointer(self, node: ast.Subscript) -> ir.Value:
        """The address of an array's entry; of rows, the record."""
        base, offset = self.value(node.value), self.value(node.slice)
        if isinstance(base.type, StructPointer) and base.type.rows and offset.type == LONG:
            return self.seen(self.row(base, offset), self.one_of(base.type))
        if base.type not in (VECTOR, INDICES, self.unit.wide_vector) or offset.type != LONG:
            raise self.fail(node, "arrays are indexed by one integer")
        return self.b.gep(base, [offset], inbounds=True)

    def value_Subscript(self, node: ast.Subscript) -> ir.Value:
        pointer = self.pointer(node)
        if isinstance(pointer.type, StructPointer):
            return pointer
        wide = pointer.type == self.unit.wide_vector
        return self.b.load(pointer, align=8) if wide else self.b.load(pointer)

    def value_Attribute(self, node: ast.Attribute) -> ir.Value:
        base = self.value(node.value)
        at = self.member(base, node.attr, node)
        place = base.type.of.places[node.attr]
        if place.kind not in ("float", "int") or base.type.stride > 1:
            return at
        return self.b.load(at, align=8) if at.type == self.unit.wide_vector else self.b.load(at)

    def value_UnaryOp(self, node: ast.UnaryOp) -> ir.Value:
        value = self.truth(node.operand) if isinstance(node.op, ast.Not) else self.value(node.operand)
        if isinstance(node.op, ast.Not):
            return self.b.not_(value)
        if value.type in (BIT, self.wide_bit):
            raise self.fail(node, "a condition has no sign; write 1 if ... else 0")
        if isinstance(node.op, ast.USub):
            return self.b.fneg(value) if value.type in (DOUBLE, self.wide) else self.b.neg(value)
        return value

    def arithmetic(self, op: ast.operator, left: ir.Value, right: ir.Value, node: ast.AST) -> ir.Value:
        for value in (left, right):
            if isinstance(value.type, ir.PointerType):
                raise self.fail(node, f"a {spelt(value.type)} is no number")
        left, right = self.alike(left, right)
        if left.type in (LONG, self.wide_long) and not isinstance(op, ast.Div | ast.Pow):
            if isinstance(op, ast.FloorDiv | ast.Mod):
                return self.divide(op, left, right)
            table = {ast.Add: "add", ast.Sub: "sub", ast.Mult: "mul"}
            table |= {ast.LShift: "shl", ast.RShift: "ashr", ast.BitAnd: "and_", ast.BitOr: "or_"}
            return getattr(self.b, table[type(op)])(left, right)
        if isinstance(op, ast.Pow):
            return self.call_power(self.double(left), self.double(right), node)
        names = {ast.Add: "fadd", ast.Sub: "fsub", ast.Mult: "fmul", ast.Div: "fdiv"}
        if type(op) not in names:
            raise self.fail(node, f"{type(op).__name__} is not defined for doubles; see floor and truncate")
        return getattr(self.b, names[type(op)])(self.double(left), self.double(right), flags=self.flags)

    def divide(self, op: ast.operator, left: ir.Value, right: ir.Value) -> ir.Value:
        """// and % of integers as in Python: rounded down, with the sign of the divisor."""
        quotient, rest = self.b.sdiv(left, right), self.b.srem(left, right)
        zero = ir.Constant(left.type, None if isinstance(left.type, ir.VectorType) else 0)
        other = self.b.icmp_signed("<", self.b.xor(rest, right), zero)
        down = self.b.and_(self.b.icmp_signed("!=", rest, zero), other)
        if isinstance(op, ast.Mod):
            return self.b.select(down, self.b.add(rest, right), rest)
        return self.b.sub(quotient, self.b.zext(down, left.type))

    def value_BinOp(self, node: ast.BinOp) -> ir.Value:
        left = self.value(node.left)
        if isinstance(node.op, ast.Pow) and isinstance(node.right, ast.Constant) and node.right.value == 2:
            return self.b.fmul(self.double(left), self.double(left))
        return self.arithmetic(node.op, left, self.value(node.right), node)

    def value_Compare(self, node: ast.Compare) -> ir.Value:
        left, result = self.value(node.left), None
        for op, comparator in zip(node.ops, node.comparators, strict=True):
            right = self.value(comparator)
            sign = _COMPARE[type(op)]
            left, right = self.alike(left, right)
            if left.type in (LONG, self.wide_long):
                test = self.b.icmp_signed(sign, left, right)
            elif sign == "!=":
                test = self.b.fcmp_unordered(sign, self.double(left), self.double(right))
            else:
                test = self.b.fcmp_ordered(sign, self.double(left), self.double(right))
            result = test if result is None else self.b.and_(*self.alike(result, test))
            left = right
        assert result is not None
        return result

    def value_BoolOp(self, node: ast.BoolOp) -> ir.Value:
        return self.joined(node, self.condition)

    def joined(self, node: ast.BoolOp, of: Callable[[ast.expr], ir.Value]) -> ir.Value:
        """`and` or `or` of conditions; short-circuited, except in lanes."""
        absorbs = isinstance(node.op, ast.Or)
        asked = []
        for item in node.values:
            known = self.settled(item)
            if known is None or known == absorbs:
                asked.append(item)
            if known == absorbs:
                break
        if len(asked) < 2:
            return of(asked[0]) if asked else ir.Constant(BIT, int(not absorbs))
        if self.kernel.wide:
            join = self.b.and_ if isinstance(node.op, ast.And) else self.b.or_
            result = of(asked[0])
            for item in asked[1:]:
                result = join(*self.alike(result, of(item)))
            return result
        slot = self.entry.alloca(BIT)
        done = self.b.append_basic_block("bool")
        for item in asked[:-1]:
            value = of(item)
            self.b.store(value, slot)
            following = self.b.append_basic_block("next")
            if isinstance(node.op, ast.And):
                self.b.cbranch(value, following, done)
            else:
                self.b.cbranch(value, done, following)
            self.b.position_at_end(following)
        self.b.store(of(asked[-1]), slot)
        self.b.branch(done)
        self.b.position_at_end(done)
        return self.b.load(slot)

    def value_IfExp(self, node: ast.IfExp) -> ir.Value:
        test = self.truth(node.test)
        if test.type == self.wide_bit:
            left, right = self.alike(self.value(node.body), self.value(node.orelse))
            if not isinstance(left.type, ir.VectorType):
                left, right = self.splat(left), self.splat(right)
            return self.b.select(test, left, right)
        yes, no, done = (self.b.append_basic_block(name) for name in ("yes", "no", "done"))
        self.b.cbranch(test, yes, no)
        self.b.position_at_end(yes)
        left = self.value(node.body)
        left_end = self.b.block
        self.b.position_at_end(no)
        right = self.value(node.orelse)
        kinds = (left.type, right.type)
        kind = left.type if left.type == right.type else self.wide if self.wide in kinds else DOUBLE
        right = self.cast(right, kind, node)
        right_end = self.b.block
        self.b.branch(done)
        self.b.position_at_end(left_end)
        left = self.cast(left, kind, node)
        self.b.branch(done)
        self.b.position_at_end(done)
        phi = self.b.phi(kind)
        phi.add_incoming(left, left_end)
        phi.add_incoming(right, right_end)
        return phi

    def call_power(self, base: ir.Value, exponent: ir.Value, node: ast.AST) -> ir.Value:
        if self.kernel.wide:
            return self.call_kernel(self.unit.widened("power"), [base, exponent], node)
        return self.b.call(self.unit.external("pow", 2), [base, exponent])

    def call_kernel(self, kernel: Kernel, values: Sequence[ir.Value], node: ast.AST) -> ir.Value:
        target = kernel.function
        if len(values) != len(target.args):
            raise self.fail(node, f"{target.name} takes {len(target.args)} arguments, given {len(values)}")
        kinds = target.ftype.args
        return self.b.call(target, [self.cast(v, k, node) for v, k in zip(values, kinds, strict=True)])

    def value_Call(self, node: ast.Call) -> ir.Value:
        name = node.func.id if isinstance(node.func, ast.Name) else getattr(node.func, "attr", "")
        if name == "each":
            of = node.args[0]
            assert isinstance(of, ast.Constant)
            return self.each(str(of.value), [self.value(argument) for argument in node.args[1:]])
        values = [self.value(argument) for argument in node.args]
        name = "exponential" if name == "exp" else name
        if self.kernel.wide and (name in self.unit.lane_texts or name in self.unit.texts):
            return self.call_kernel(self.unit.widened(name), values, node)
        if name in self.unit.texts:
            return self.call_kernel(self.unit.plain(name), values, node)
        if name in ("min", "max"):
            return self.choose(values, "<" if name == "min" else ">")
        if name == "abs" and values[0].type == LONG:
            return self.choose([values[0], self.b.neg(values[0])], ">")
        if name in ("abs", "fabs"):
            return self.intrinsic("llvm.fabs", [self.double(values[0])])
        if name == "sqrt":
            return self.intrinsic("llvm.sqrt", [self.double(values[0])])
        if name == "rint":
            return self.intrinsic("llvm.rint", [self.double(values[0])])
        if name == "two_to":
            # The bits of 2**n, |n| < 1023.
            bits = self.b.add(*self.alike(values[0], ir.Constant(LONG, 1023)))
            bits = self.b.shl(*self.alike(bits, ir.Constant(LONG, 52)))
            return self.b.bitcast(bits, self.wide if bits.type == self.wide_long else DOUBLE)
        if name == "to_bits":
            bits = self.double(values[0])
            return self.b.bitcast(bits, self.wide_long if bits.type == self.wide else LONG)
        if name == "from_bits":
            return self.b.bitcast(values[0], self.wide if values[0].type == self.wide_long else DOUBLE)
        if name in ("anywhere", "everywhere", "mask_bits"):
            return self.ask(name, self.bit(values[0]))
        if name == "claim":
            place = self.b.gep(values[0], [values[1]], inbounds=True)
            return self.b.atomic_rmw("add", place, ir.Constant(LONG, 1), "monotonic")
        if name == "call_at":
            kind = ir.FunctionType(LONG, [value.type for value in values[1:]])
            return self.b.call(self.b.inttoptr(values[0], kind.as_pointer()), values[1:])
        if name == "fma":
            return self.intrinsic("llvm.fma", [self.double(v) for v in values])
        if name == "float":
            return self.double(values[0])
        if name == "truncate":
            return self.b.fptosi(values[0], self.wide_long if values[0].type == self.wide else LONG)
        if name in ("side_by_side", "all_of", "size_of"):
            return self.of_record(name, values[0], node)
        if name == "shift_rows" and isinstance(values[0].type, StructPointer) and values[0].type.rows:
            return self.seen(self.row(values[0], values[1]), values[0].type)
        if name in ("shift", "shift_indices"):
            if values[0].type not in (VECTOR, INDICES, self.unit.wide_vector):
                raise self.fail(node, f"a {spelt(values[0].type)} where an array is needed")
            return self.b.gep(values[0], [values[1]], inbounds=True)
        if name == "power":
            return self.call_power(self.double(values[0]), self.double(values[1]), node)
        if name in _CALLBACKS:
            kinds = [DOUBLE] + [VECTOR] * (_CALLBACKS[name] - 1)
            pointer = self.b.inttoptr(values[0], ir.FunctionType(LONG, kinds).as_pointer())
            return self.b.call(pointer, values[1:])
        if name in LIBRARY and self.kernel.wide:
            return self.each(name, values)
        if name in LIBRARY:
            return self.b.call(self.unit.external(name, LIBRARY[name]), [self.double(v) for v in values])
        if name in self.unit.lane_texts:
            return self.call_kernel(self.unit.widened(name), values, node)
        raise self.fail(node, f"unknown function {name}")

    def of_record(self, name: str, value: ir.Value, node: ast.AST) -> ir.Value:
        if not isinstance(value.type, StructPointer) or value.type.rows:
            raise self.fail(node, f"a {spelt(value.type)} where a record is needed")
        if name == "size_of":
            return self.length(value.type.of.__name__, value.type.of.size)
        if name == "all_of":
            element = value.type.pointee if value.type.of.doubles else LONG
            return self.seen(value, self.unit.address(element))
        return self.cast(value, self.unit.record(value.type.of, True), node)

    # Statements

    def block(self, statements: Sequence[ast.stmt]) -> None:
        for statement in statements:
            if self.b.block.is_terminated:
                return
            method: Callable[[ast.stmt], None] | None = getattr(self, f"do_{type(statement).__name__}", None)
            if method is None:
                raise self.fail(statement, f"{type(statement).__name__} is not part of the kernel language")
            method(statement)

    def assign(self, target: ast.expr, value: ir.Value) -> None:
        if isinstance(target, ast.Name):
            self.store(target.id, value, target)
        elif isinstance(target, ast.Subscript | ast.Attribute):
            pointer = self.place(target) if isinstance(target, ast.Attribute) else self.pointer(target)
            if isinstance(pointer.type, StructPointer):
                raise self.fail(target, "a record is no number; assign to its names")
            aligned = {"align": 8} if pointer.type == self.unit.wide_vector else {}
            self.b.store(self.cast(value, pointer.type.pointee, target), pointer, **aligned)
        elif isinstance(target, ast.Tuple) and isinstance(value.type, ir.LiteralStructType):
            self.same_length(target, target.elts, value.type.elements)
            for i, item in enumerate(target.elts):
                self.assign(item, self.b.extract_value(value, i))
        else:
            raise self.fail(target, "cannot assign to this")

    def place(self, target: ast.Attribute) -> ir.Value:
        """The address at which a record's member is written: a number, or a reference."""
        base = self.value(target.value)
        at = self.member(base, target.attr, target)
        place = base.type.of.places[target.attr]
        if place.elsewhere:
            return self.seen(self.word(base, target.attr), self.unit.address(at.type))
        if place.kind not in ("float", "int") or base.type.stride > 1:
            what = f"{target.attr} is a part of record {base.type.label}"
            raise self.fail(target, f"{what}; assign to its entries")
        return at

    def same_length(self, node: ast.AST, left: Sequence[object], right: Sequence[object]) -> None:
        if len(left) != len(right):
            raise self.fail(node, f"{len(left)} names or values stand beside {len(right)}")

    def do_Assign(self, node: ast.Assign) -> None:
        target = node.targets[0]
        if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple) and len(node.targets) == 1:
            self.same_length(node, target.elts, node.value.elts)
            values = [self.value(item) for item in node.value.elts]
            for item, value in zip(target.elts, values, strict=True):
                self.assign(item, value)
            return
        value = self.value(node.value)
        for target in node.targets:
            self.assign(target, value)

    def do_AugAssign(self, node: ast.AugAssign) -> None:
        load: ast.expr = node.target
        self.assign(node.target, self.arithmetic(node.op, self.value(load), self.value(node.value), node))

    def do_Expr(self, node: ast.Expr) -> None:
        if not isinstance(node.value, ast.Constant):
            self.value(node.value)

    def do_Pass(self, node: ast.Pass) -> None:
        pass

    def do_Return(self, node: ast.Return) -> None:
        kind = self.kernel.function.ftype.return_type
        if node.value is None:
            if kind != VOID:
                raise self.fail(node, "a return without a value")
            self.b.ret_void()
        elif isinstance(node.value, ast.Tuple):
            if not isinstance(kind, ir.LiteralStructType):
                raise self.fail(node, f"a tuple where a {kind} is returned")
            self.same_length(node, node.value.elts, kind.elements)
            result: ir.Value = ir.Constant(kind, ir.Undefined)
            for i, item in enumerate(node.value.elts):
                result = self.b.insert_value(result, self.cast(self.value(item), kind.elements[i], node), i)
            self.b.ret(result)
        else:
            self.b.ret(self.cast(self.value(node.value), kind, node))

    def do_If(self, node: ast.If) -> None:
        known = self.settled(node.test)
        if known is not None:
            self.block(node.body if known else node.orelse)
            return
        yes, no, done = (self.b.append_basic_block(name) for name in ("then", "else", "endif"))
        self.b.cbranch(self.test(node.test), yes, no)
        for start, statements in ((yes, node.body), (no, node.orelse)):
            self.b.position_at_end(start)
            self.block(statements)
            if not self.b.block.is_terminated:
                self.b.branch(done)
        self.b.position_at_end(done)

    def loop(self, test: _Test, body: Sequence[ast.stmt], after: Callable[[], None] = lambda: None) -> None:
        """A loop that runs while a test holds; without one it is left by break and return only."""
        head, inside, step, done = (self.b.append_basic_block(n) for n in ("head", "loop", "step", "endloop"))
        self.b.branch(head)
        self.b.position_at_end(head)
        asked = test()
        self.b.branch(inside) if asked is None else self.b.cbranch(asked, inside, done)
        self.b.position_at_end(inside)
        self.loops.append((step, done))
        self.block(body)
        self.loops.pop()
        if not self.b.block.is_terminated:
            self.b.branch(step)
        self.b.position_at_end(step)
        after()
        self.b.branch(head)
        self.b.position_at_end(done)

    def do_While(self, node: ast.While) -> None:
        endless = self.settled(node.test) is True
        self.loop(lambda: None if endless else self.test(node.test), node.body)

    def do_For(self, node: ast.For) -> None:
        assert isinstance(node.iter, ast.Call)  # `strict` has checked that
        assert isinstance(node.target, ast.Name)
        values = [self.value(argument) for argument in node.iter.args]
        one = ir.Constant(LONG, 1)
        start, stop = (ir.Constant(LONG, 0), values[0]) if len(values) == 1 else (values[0], values[1])
        step = values[2] if len(values) == 3 else one
        down = len(values) == 3 and step_of(node.iter.args[2]) < 0
        counter = self.entry.alloca(LONG)
        self.b.store(start, counter)
        name = node.target.id

        def test() -> ir.Value:
            current = self.b.load(counter)
            self.store(name, current)
            return self.b.icmp_signed(">" if down else "<", current, stop)

        def after() -> None:
            self.b.store(self.b.add(self.b.load(counter), step), counter)

        self.loop(test, node.body, after)

    def do_Break(self, node: ast.Break) -> None:
        self.b.branch(self.loops[-1][1])

    def do_Continue(self, node: ast.Continue) -> None:
        self.b.branch(self.loops[-1][0])


def translate(unit: Unit, kernel: Kernel) -> None:
    """Fill the kernel's LLVM function; raises KernelError where it leaves the language."""
    _Body(unit, kernel)
