declare module "@kitware/vtk.js/Filters/General/ImageMarchingCubes" {
  import type { vtkAlgorithm, vtkObject } from "@kitware/vtk.js/interfaces";

  interface ImageMarchingCubes extends vtkObject, vtkAlgorithm {
    setContourValue(value: number): boolean;
  }
  const filter: { newInstance(options: { computeNormals: boolean; mergePoints: boolean }): ImageMarchingCubes };
  export default filter;
}
