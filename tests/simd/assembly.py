"""Machine code of kernels as text, and as objects for other machines."""

import llvmlite.binding as llvm

from hoof_env.simd.compile import CODE_MODEL, LEVEL, compiled, optimised, relocation, target, traced


def text_of(kernel):
    """Instructions of a kernel."""
    return traced(kernel.function, kernel.parameters)[0]


def assembly_of(kernel):
    """Assembly of a kernel for this processor, or for the processor that HOOF_ENV_CPU names."""
    return target().emit_assembly(optimised(text_of(kernel)))


def object_for(kernel, triple, cpu=""):
    """The object of a kernel for another machine."""
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    made = llvm.Target.from_triple(triple)
    machine = made.create_target_machine(
        cpu=cpu, opt=LEVEL, reloc=relocation(made.name), codemodel=CODE_MODEL, jit=True
    )
    return compiled(text_of(kernel), machine)
