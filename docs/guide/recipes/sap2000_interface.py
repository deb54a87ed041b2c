import comtypes.client

from skthermo.fem import CallableModel

sap = comtypes.client.GetActiveObject("CSI.SAP2000.API.SapObject").SapModel
moduli = {"DECK": 30e9, "ARCH": 210e9}  # of the materials, in the units of the model


def frequencies(theta):
    sap.SetModelIsLocked(False)
    for (material, E), multiplier in zip(moduli.items(), theta):
        sap.PropMaterial.SetMPIsotropic(material, E * multiplier, 0.2, 1e-5)
    sap.Analyze.RunAnalysis()
    sap.Results.Setup.DeselectAllCasesAndCombosForOutput()
    sap.Results.Setup.SetCaseSelectedForOutput("MODAL")
    results = sap.Results.ModalPeriod(0, [], [], [], [], [], [], [])
    return results[5][:4]  # after the case, step and period


model = CallableModel(frequencies, ["E_deck", "E_arch"], 4, cache="bridge.solved")
