#include "tests/bench/vtk_contours.h"

#include <vtkFloatArray.h>
#include <vtkFlyingEdges3D.h>
#include <vtkImageData.h>
#include <vtkMarchingCubes.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPolyData.h>
#include <vtkSMPTools.h>

namespace strata {
namespace {

template <typename Filter>
uint64_t contour_by(const float* values, int samples) {
    vtkNew<vtkFloatArray> array;
    array->SetArray(const_cast<float*>(values), vtkIdType(samples) * samples * samples, 1);
    vtkNew<vtkImageData> image;
    image->SetDimensions(samples, samples, samples);
    image->GetPointData()->SetScalars(array);
    vtkNew<Filter> filter;
    filter->SetInputData(image);
    filter->SetValue(0, 0.0);
    filter->ComputeNormalsOff();
    filter->ComputeGradientsOff();
    filter->ComputeScalarsOff();
    filter->Update();
    return uint64_t(filter->GetOutput()->GetNumberOfPolys());
}

}  // namespace

uint64_t flying_edges(const float* values, int samples, int threads) {
    vtkSMPTools::Initialize(threads);
    return contour_by<vtkFlyingEdges3D>(values, samples);
}

uint64_t vtk_marching_cubes(const float* values, int samples) { return contour_by<vtkMarchingCubes>(values, samples); }

}  // namespace strata
