"""Compile kernels to machine code: Python's syntax tree -> LLVM IR -> object code, one module per unit.

A general just-in-time compiler takes twenty times as long, because types are annotated here and arrays are
bare pointers.
"""

from collections.abc import Mapping, Sequence

from llvmlite import binding

from filippov.kernel.language.translate import translate
from filippov.kernel.language.unit import Constant, Unit

# Kernels with more operations than this are not copied into their callers in a unit that is linked with
# another: the optimiser's time grows faster than the size of a function, and the stages gain nothing by it.
WHOLE = 92
# The same in a unit that holds everything, where the field is copied into every stage if it is no larger.
PART = 620


def compile_unit(
    unit: Unit,
    constants: Mapping[str, Constant],
    exported: Sequence[str],
    in_lanes: Sequence[str] = (),
    given: Mapping[str, Sequence[float]] | None = None,
    missing: Sequence[str] = (),
) -> bytes:
    """Object code of a unit: the exported kernels, which keep their names, and what they call (or all).

    in_lanes: kernels exported in their widened form, as `name.lanes`; given: tables of constants for other
    units; missing: kernels that other units name and never call, defined here to end the process
    """
    module = binding.parse_assembly(written(unit, constants, exported, in_lanes, given, missing))
    module.verify()
    machine = target_machine()
    module.triple, module.data_layout = machine.triple, str(machine.target_data)
    # Level 3 takes a quarter longer and makes the event loop no faster.
    options = binding.create_pipeline_tuning_options(speed_level=2)
    # Loops whose length is known only at run time are short, and gain nothing by unrolling.
    options.loop_unrolling = not unit.shape
    # Pairs looked for in the straight code of a system take most of the time of a long unit, and make its
    # recurrences slower.
    options.slp_vectorization, options.loop_vectorization = given is None, False
    builder = binding.create_pass_builder(machine, options)
    builder.getModulePassManager().run(module, builder)
    return bytes(machine.emit_object(module))


def written(
    unit: Unit, constants: Mapping[str, Constant], exported: Sequence[str], in_lanes: Sequence[str] = (),
    given: Mapping[str, Sequence[float]] | None = None, missing: Sequence[str] = (),
) -> str:  # fmt: skip
    """The kernels of a unit as LLVM IR, neither verified nor optimised; arguments as of `compile_unit`."""
    unit.constants.update(constants)
    for name in exported or unit.texts:
        unit.plain(name)
    for name in in_lanes if exported else unit.lane_texts:
        unit.widened(name)
    while unit.waiting:
        translate(unit, unit.waiting.pop(0))
    for kernel in (*map(unit.plain, exported), *map(unit.widened, in_lanes)):
        kernel.function.linkage = "external"
    for name, values in (given or {}).items():
        unit.table(name, values)
        unit.tables[name].linkage = ""
    for kernel in unit.kernels.values():
        most = WHOLE if unit.foreign and not kernel.flags else PART
        written = sum(len(block.instructions) for block in kernel.function.blocks)
        if written > most and "alwaysinline" not in kernel.function.attributes:
            kernel.function.attributes.add("noinline")
    for name in missing:
        unit.trap(name)
    return str(unit.module)


def target_machine() -> binding.TargetMachine:
    """Code for this processor with all its vector instructions."""
    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    target = binding.Target.from_default_triple()
    features = binding.get_host_cpu_features().flatten()
    return target.create_target_machine(
        cpu=binding.get_host_cpu_name(),
        features=features,
        opt=3,
        jit=True,
        reloc="default",
        codemodel="jitdefault",
    )


def load_objects(*codes: bytes) -> binding.ExecutionEngine:
    """An engine with the functions of object files that call each other; it owns their memory: keep it."""
    machine = target_machine()
    empty = binding.parse_assembly(f'target triple = "{machine.triple}"')
    engine = binding.create_mcjit_compiler(empty, machine)
    for code in codes:
        engine.add_object_file(binding.ObjectFileRef.from_data(code))
    engine.finalize_object()
    return engine


def load_module(text: str) -> binding.ExecutionEngine:
    """An engine with the functions of LLVM IR as it stands; it owns their memory: keep it."""
    machine = target_machine()
    module = binding.parse_assembly(text)
    module.triple = machine.triple
    engine = binding.create_mcjit_compiler(module, machine)
    engine.finalize_object()
    return engine
